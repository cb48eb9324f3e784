// The whole library: the loader of packages into scenes, and the reader with its decisions. `texmesh/open` is the part that an
// application needs which only shows packages.

export * from './reader';
export { TexmeshPackage, open } from './open';
export type * from './scene/api';
