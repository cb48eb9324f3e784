// The package reader and the decisions about what to load, without three.js: works in Node.js and browsers.

export * from './errors';
export * from './manifest';
export * from './layout';
export * from './entry_paths';
export * from './index_table';
export * from './textures';
export * from './read_textures';
export * from './tables';
export * from './read_tables';
export * from './quality_table';
export * from './codec';
export * from './join_fragment';
export * from './allocation';
export * from './viewing';
export * from './throughput';
export * from './harmonic_time';
export * from './upgrades';
export * from './fragment_list';
export * from './prediction';
export * from './scale_choice';
export * from './link_model';
export * from './delivery_plan';
/** Functions whose results have the same bits everywhere. */
export * as portable from './portable_math';
export { toHex } from './bytes';
export { sha256 } from './sha256';
export { sha256Js } from './sha256_js';
export type { HttpOptions, RequestKind, RequestRecord } from './http';
export type { PackageForm, PackageStore, Place, ReadOptions, StoreMode } from './store';
export { PackageReader } from './package_reader';
export type { OpenOptions } from './package_reader';
