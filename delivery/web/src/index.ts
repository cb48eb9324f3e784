import { OpenOptions, PackageReader } from './package_reader';

export * from './reader';
export type * from './api';

/** A package that can be shown in a three.js scene. */
export class TexmeshPackage extends PackageReader {}

/**
 * Opens a package: one request of 16 KiB. `url` is that of a .texmesh file, or of the folder that `texmesh unpack` made
 * of one, ending in a slash. InputError when the server does not deliver, FormatError when it is no package.
 */
export function open(url: string, options: OpenOptions = {}): Promise<TexmeshPackage> {
  return TexmeshPackage.openUrl(url, options);
}
