// What is parsed after the manifest; loaded when it is first needed.

export { readIndex, readIndexHead, readIndexPage } from './index_table';
export { readQuality } from './quality_table';
export { readTablesHead, readTablesSection } from './tables';
export { fullSizePlanes, missingFeature, readTextures } from './textures';
