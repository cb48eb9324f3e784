import { expect, it } from 'vitest';
import { fakeServer } from '../support/fake_server';
import { loading, until } from '../support/loading';
import { files, url } from '../support/scan';

it('who gives up an override in the timed part does not ask for everything', async () => {
  const server = fakeServer(files);
  const l = await loading(url, server, { rung: 0, time: 5, autoRefine: false });
  expect(await until(() => l.pkg.requests.some((q) => q.kind === 'texture'))).toBe(true);
  l.model.setOverride({});
  let inTime = -1;
  l.model.on('deadline', () => (inTime = Math.max(...l.model.state.planes.flatMap((p) => [...p.rungs]))));
  await l.model.done;
  expect(inTime).toBe(0);
  l.dispose();
});
