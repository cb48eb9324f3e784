// Everything: what shows packages, and the reader with its decisions. `texmesh/open` is the part that an application
// needs which only shows them.

export * from './reader';
export { TexmeshPackage, open } from './open';
export type * from './scene/api';
