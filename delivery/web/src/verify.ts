import { checkPackage } from './check/checks';
import type { PackageSource } from './check/container';
import { DecodePicture, decodeByBrowser } from './check/pictures';

// Looks at every byte of a package, by the rules of format/rules.txt and schemas/ themselves. No other entry needs it.

export type { PackageSource } from './check/container';
export type { DecodePicture } from './check/pictures';
export { FormatError, TexmeshError } from './format/errors';

/** Options of verifyPackage(). */
export interface VerifyOptions {
  /**
   * Decodes pictures; by default the browser does. Where nobody does, as in Node.js, pictures are held to what their heads say and to
   * their digests.
   */
  decode?: DecodePicture;
}

/**
 * Resolves where a package keeps the rules of format/SPEC.md that a checker has to look at; FormatError otherwise, whose `rule` names the
 * first rule that is found broken. GLBs are not decoded: `texmesh verify` does that as well.
 */
export async function verifyPackage(source: PackageSource, options: VerifyOptions = {}): Promise<void> {
  await checkPackage(source, options.decode ?? decodeByBrowser);
}
