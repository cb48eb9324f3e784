// The package reader and the decisions that loads take, without three.js.

export { FormatError, InputError, TexmeshError } from './format/errors';
export * from './format/manifest';
export * from './format/layout';
export * from './format/entry_paths';
export * from './format/about';
export * from './format/index_table';
export * from './format/textures';
export * from './format/tables';
export * from './format/read_tables';
export * from './format/quality_table';
export * from './format/codec';
export * from './decide/allocation';
export * from './decide/rate_distortion';
export * from './decide/size_curve';
export * from './decide/viewing';
export * from './http/throughput';
export type * from './decide/harmonic_time';
export * from './decide/texture_loss';
export * from './decide/fragment_list';
export * from './decide/texture_budget';
export type { PackageData } from './format/tables';
export * from './decide/prediction';
export * from './decide/scale_choice';
export * from './decide/simulation';
export * from './decide/proxy_choice';
/** Functions whose results have the same bits everywhere. */
export * as portable from './decide/portable_math';
export { toHex } from './format/sha256';
export { sha256 } from './format/sha256';
export { sha256Js } from './format/sha256_js';
export type { HttpOptions } from './http/store';
export type { RequestKind, RequestRecord } from './http/requests';
export type { PackageForm, PackageStore, Place, ReadOptions, StoreMode } from './http/store';
export { PackageReader } from './http/package_reader';
export type { OpenOptions } from './http/package_reader';
