// What leaves texmesh for other programs and for pages: exports, sites, applications, experiments. Nothing of it is held to a time, so that
// other tests may run beside it.
import {closeCommon, env, pictures} from './browser.mjs';
import {runAll} from './harness.mjs';
import {makePackages} from './make-packages.mjs';
import './application-tests.mjs';
import './publish-tests.mjs';
import './usdz-tests.mjs';

if (env.lab) await import('./experiment-tests.mjs');

makePackages();
const code = await runAll('web_publish');
console.log(`pictures in ${pictures}`);
await closeCommon();
process.exit(code);
