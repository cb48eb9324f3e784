// What the build makes one part of, loaded while the first picture comes.

export { splitShapes } from './split_shape';
export { textureLoad } from './texture_load';
