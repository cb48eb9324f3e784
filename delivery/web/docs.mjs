// Every export and every member of the interfaces of scene/api, page and page/page_model has a comment: fails and names those without. After a build; part of check-types.
//   node docs.mjs [DIST/TYPES]
import { join } from 'node:path';
import ts from 'typescript';

const types = process.argv[2] ?? 'dist/types';
const file = (name) => join(types, `${name}.d.ts`);
const entries = ['index', 'open', 'page', 'reader', 'thesis', 'notes', 'worker'];
const node = ts.ModuleKind.NodeNext;
const program = ts.createProgram(entries.map(file), { module: node, moduleResolution: ts.ModuleResolutionKind.NodeNext, skipLibCheck: true });
const checker = program.getTypeChecker();
const said = (symbol) => symbol.getDocumentationComment(checker).length > 0;
const bare = new Set();
let seen = 0;
for (const entry of entries)
  for (const e of checker.getExportsOfModule(checker.getSymbolAtLocation(program.getSourceFile(file(entry))))) {
    ++seen;
    const whole = e.declarations?.some((d) => ts.isNamespaceExport(d) && ts.getJSDocCommentsAndTags(d.parent).length > 0);
    const own = e.flags & ts.SymbolFlags.Alias ? checker.getAliasedSymbol(e) : e;
    if (!whole && !said(own)) bare.add(e.name);
  }
for (const api of ['scene/api', 'page/page_model', 'page']) ts.forEachChild(program.getSourceFile(file(api)), (d) => {
  for (const m of ts.isInterfaceDeclaration(d) ? d.members : []) {
    ++seen;
    if (ts.getJSDocCommentsAndTags(m).length === 0) bare.add(`${d.name.text}.${m.name?.getText()}`);
  }
});
if (seen < 100) throw new Error(`only ${seen} names in ${types}`);
if (bare.size > 0) console.error(`without a comment: ${[...bare].join(', ')}`);
process.exit(bare.size > 0 ? 1 : 0);
