import { readFileSync, readdirSync } from 'node:fs';
import { dirname, join } from 'node:path';
import { fileURLToPath } from 'node:url';
import { describe, expect, it } from 'vitest';
import { root } from './support/files';
import { Sources, circles, importsOf, most, roomsBelow, tooLarge, wrongWays } from './support/source_rules';

// What the source tree promises a reader: rooms in an order, no circles, nothing too long to take in.

const web = join(dirname(fileURLToPath(import.meta.url)), '..');
const filesOf = (folder: string, ending: string): string[] =>
  (readdirSync(folder, { recursive: true }) as string[]).map((file) => file.replaceAll('\\', '/'))
    .filter((file) => file.endsWith(ending));
const sourcesOf = (folder: string): Sources =>
  new Map(filesOf(folder, '.ts').map((file) => [file, readFileSync(join(folder, file), 'utf8')]));
const sources = sourcesOf(join(web, 'src'));
const viewer = sourcesOf(join(root, 'examples/viewer/src'));
const planted = (...files: [name: string, text: string][]): Sources => new Map([...sources, ...files]);

it('the rooms are those that there are', () => {
  const rooms = new Set([...sources.keys()].filter((file) => file.includes('/'))
    .map((file) => file.slice(0, file.indexOf('/'))));
  expect([...rooms].sort()).toEqual(Object.keys(roomsBelow).sort());
  // imports are found at all
  expect([...importsOf(sources).values()].flat().length).toBeGreaterThan(sources.size);
});
it('no imports go round in a circle', () => expect(circles(sources)).toEqual([]));
it('rooms import from the rooms below them only', () => expect(wrongWays(sources)).toEqual([]));
it('no function, class, file or folder is too large', () => expect(tooLarge(sources)).toEqual([]));

it('every folder of tests is one of sources', () => {
  const folders = new Set(filesOf(join(web, 'tests'), '.test.ts').map((file) => dirname(file)));
  const ofSources = new Set([...sources.keys()].map((file) => dirname(file)));
  expect(folders.size).toBeGreaterThan(5);
  expect([...folders].filter((folder) => !ofSources.has(folder))).toEqual([]);
});

it('a planted circle is found, whatever form its imports have', () => {
  for (const back of ["import { a } from './a';", "export * from './a';", "import type { A } from './a';",
      "const later = () => import('./a');", "type A = typeof import('./a');"])
    expect(circles(planted(['http/a.ts', "import { b } from './b';\n"], ['http/b.ts', `${back}\n`])))
      .toEqual(['http/a.ts -> http/b.ts -> http/a.ts']);
});
it('a planted import of a room above is found', () => {
  expect(wrongWays(planted(['format/up.ts', "import { HttpClient } from '../http/client';\n"])))
    .toEqual(['format/up.ts -> http/client.ts']);
  expect(wrongWays(planted(['worker/aside.ts', "import type { HttpClient } from '../http/client';\n"])))
    .toEqual(['worker/aside.ts -> http/client.ts']);
  expect(wrongWays(planted(['scene/out.ts', "import { open } from '../open';\n"])))
    .toEqual(['scene/out.ts -> open.ts']);
});
it('what is planted too large is found', () => {
  const lines = (n: number): string => 'void 0;\n'.repeat(n);
  expect(tooLarge(planted(['http/long.ts', `export function long() {\n${lines(most.functionLines - 1)}}\n`])))
    .toEqual(['http/long.ts:1: 81 lines of 80']);
  expect(tooLarge(
    planted(['http/closure.ts', `export const long = () => {\n${lines(most.functionLines - 1)}};\n`])))
    .toEqual(['http/closure.ts:1: 81 lines of 80']);
  expect(
    tooLarge(planted(['http/class.ts', `export class Long {\n${'a = 0;\n'.repeat(most.classLines - 1)}}\n`])))
    .toEqual(['http/class.ts:1: 401 lines of 400']);
  expect(tooLarge(planted(['http/file.ts', lines(most.fileLines + 1)])))
    .toEqual(['http/file.ts: 701 lines of 700']);
  const many = Array.from({ length: most.filesInFolder + 1 },
    (_, i): [string, string] => [`http/more/${i}.ts`, lines(1)]);
  expect(tooLarge(planted(...many))).toEqual(['http/more: 25 files of 24']);
});

describe("the viewer's sources", () => {
  it('are found with their imports', () => {
    expect([...viewer.keys()])
      .toEqual(expect.arrayContaining(['main.ts', 'panel/panel.ts', 'session/session.ts', 'stage/stage.ts']));
    expect(importsOf(viewer).get('main.ts')).toContain('app.ts');
  });
  it('have no imports that go round in a circle', () => expect(circles(viewer)).toEqual([]));
  it('are no larger than those of the library', () => expect(tooLarge(viewer)).toEqual([]));
  it('are found with a planted circle, class and function', () => {
    const lines = 'void 0;\n'.repeat(most.functionLines - 1);
    const bad = new Map([...viewer, ['back.ts', "import { make } from './dom';\n"],
      ['dom.ts', `import './back';\n${viewer.get('dom.ts')}`],
      ['session/class.ts', `export class Long {\n${'a = 0;\n'.repeat(most.classLines - 1)}}\n`],
      ['panel/long.ts', `export function long() {\n${lines}}\n`]]);
    expect(circles(bad)).toEqual(['dom.ts -> back.ts -> dom.ts']);
    expect(tooLarge(bad))
      .toEqual(['session/class.ts:1: 401 lines of 400', 'panel/long.ts:1: 81 lines of 80']);
  });
});
