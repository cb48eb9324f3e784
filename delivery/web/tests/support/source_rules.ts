import { dirname, join, normalize } from 'node:path/posix';
import ts from 'typescript';

/** Source files by their path beneath src. */
export type Sources = Map<string, string>;

/**
 * The rooms that the files of each room may import from, besides their own. Files beneath no room, the
 * entries, may import all.
 */
export const roomsBelow: Record<string, readonly string[]> = {
  format: [],
  http: ['format'],
  blocks: [],
  worker: ['format', 'blocks'],
  decide: ['format', 'http'],
  scene: ['format', 'http', 'blocks', 'worker', 'decide'],
  page: ['format', 'http', 'decide', 'scene'],
  notes: ['format', 'http', 'scene', 'page'],
  element: ['format', 'page', 'notes'],
};

/** Lines of a function, of a class, of a file, of the median file, and files in a folder. */
export const most = { functionLines: 80, classLines: 400, fileLines: 700, medianLines: 160,
  filesInFolder: 24 };

const roomOf = (file: string): string => (file.includes('/') ? file.slice(0, file.indexOf('/')) : '');
const linesOf = (text: string): number => text.split('\n').length - 1;

const parsedFiles = new Map<string, ts.SourceFile>();
/** Each text is parsed once. */
function parsed(file: string, text: string): ts.SourceFile {
  const known = parsedFiles.get(file);
  if (known?.text === text) return known;
  const source = ts.createSourceFile(file, text, ts.ScriptTarget.Latest, true);
  parsedFiles.set(file, source);
  return source;
}

/** A function of a source file that is called once for each file. */
function once<T>(read: (source: ts.SourceFile) => T): (source: ts.SourceFile) => T {
  const results = new WeakMap<ts.SourceFile, T>();
  return (source) => {
    if (!results.has(source)) results.set(source, read(source));
    return results.get(source)!;
  };
}

/** The imports of a file, of whatever form: import, export from, import(), typeof import(). */
const specifiersOf = once(readSpecifiers);
function readSpecifiers(source: ts.SourceFile): string[] {
  const found: string[] = [];
  const visit = (node: ts.Node): void => {
    if ((ts.isImportDeclaration(node) || ts.isExportDeclaration(node)) && node.moduleSpecifier)
      found.push((node.moduleSpecifier as ts.StringLiteral).text);
    if (ts.isCallExpression(node) && node.expression.kind === ts.SyntaxKind.ImportKeyword &&
        ts.isStringLiteral(node.arguments[0])) found.push(node.arguments[0].text);
    if (ts.isImportTypeNode(node) && ts.isLiteralTypeNode(node.argument))
      found.push((node.argument.literal as ts.StringLiteral).text);
    ts.forEachChild(node, visit);
  };
  visit(source);
  return found;
}

/** The files of `sources` that each file imports. */
export function importsOf(sources: Sources): Map<string, string[]> {
  return new Map([...sources].map(([file, text]) => {
    const named = specifiersOf(parsed(file, text)).filter((name) => name.startsWith('.'));
    const paths = named.map((name) => `${normalize(join(dirname(file), name))}.ts`);
    return [file, paths.filter((path) => sources.has(path))];
  }));
}

/** Circles of imports, each as the files on its way. */
export function circles(sources: Sources): string[] {
  const imports = importsOf(sources);
  const done = new Set<string>();
  const found: string[] = [];
  const follow = (file: string, way: string[]): void => {
    const at = way.indexOf(file);
    if (at >= 0) found.push([...way.slice(at), file].join(' -> '));
    if (at >= 0 || done.has(file)) return;
    for (const next of imports.get(file)!) follow(next, [...way, file]);
    done.add(file);
  };
  for (const file of sources.keys()) follow(file, []);
  return found;
}

/** Imports that rooms do not allow. */
export function wrongWays(sources: Sources): string[] {
  return [...importsOf(sources)].flatMap(([file, imported]) => {
    const room = roomOf(file);
    const allowed = room === '' ? undefined : [room, ...(roomsBelow[room] ?? [])];
    return imported.filter((to) => allowed && !allowed.includes(roomOf(to))).map((to) => `${file} -> ${to}`);
  });
}

/** Functions and classes of a file that are too long. */
const longParts = once((source) => {
  const found: string[] = [];
  const lineOf = (position: number): number => source.getLineAndCharacterOfPosition(position).line;
  const visit = (node: ts.Node): void => {
    const limit = ts.isClassLike(node) ? most.classLines
      : ts.isFunctionLike(node) ? most.functionLines : Infinity;
    const first = limit < Infinity ? lineOf(node.getStart()) : 0;
    const lines = limit < Infinity ? lineOf(node.end) - first + 1 : 0;
    if (lines > limit) found.push(`${source.fileName}:${first + 1}: ${lines} lines of ${limit}`);
    ts.forEachChild(node, visit);
  };
  visit(source);
  return found;
});

/** Functions, classes and files that are too long, and folders with too many files. */
export function tooLarge(sources: Sources): string[] {
  const found: string[] = [];
  const folders = new Map<string, number>();
  for (const [file, text] of sources) {
    found.push(...longParts(parsed(file, text)));
    if (linesOf(text) > most.fileLines) found.push(`${file}: ${linesOf(text)} lines of ${most.fileLines}`);
    folders.set(dirname(file), (folders.get(dirname(file)) ?? 0) + 1);
  }
  for (const [folder, count] of folders) if (count > most.filesInFolder)
    found.push(`${folder}: ${count} files of ${most.filesInFolder}`);
  const median = [...sources.values()].map(linesOf).sort((a, b) => a - b)[sources.size >> 1];
  if (median > most.medianLines) found.push(`median file: ${median} lines of ${most.medianLines}`);
  return found;
}
