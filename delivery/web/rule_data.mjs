// The data that texmesh/verify follows, as a module of its own name: format/rules.txt, and the schemas without what only people read.
import { readFileSync } from 'node:fs';
import { dirname, join } from 'node:path';
import { fileURLToPath } from 'node:url';

const root = process.env.TEXMESH_ROOT ?? join(dirname(fileURLToPath(import.meta.url)), '..', '..');
const name = 'texmesh-rules';

function module() {
  const forPeople = (key, value) => (typeof value === 'string' && (key === 'title' || key === 'description') ? undefined : value);
  const schemas = {};
  for (const schema of ['manifest', 'textures', 'quality', 'about'])
    schemas[schema] = JSON.parse(readFileSync(join(root, `schemas/${schema}.v2.schema.json`), 'utf8'), forPeople);
  const rules = readFileSync(join(root, 'format/rules.txt'), 'utf8');
  return `export const rules = ${JSON.stringify(rules)};\nexport const schemas = ${JSON.stringify(schemas)};\n`;
}
/** For Rollup and Vite. */
export const ruleData = {
  name,
  resolveId: (id) => (id === name ? `\0${name}` : null),
  load: (id) => (id === `\0${name}` ? module() : null),
};
