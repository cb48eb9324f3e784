// The whole library: the loader of packages into scenes, and the reader with the decisions that loads take;
// `texmesh/reader` plans whole deliveries, too. `texmesh/open` is the part that an application needs which
// only shows packages.

export * from './decisions';
export { TexmeshPackage, open } from './open';
export { daylight, isMetallic } from './page/daylight';
export { frame } from './page/framing';
export { firstLookFovDegrees } from './format/shared_numbers';
export { reflectSky } from './page/sky';
export type * from './scene/api';
