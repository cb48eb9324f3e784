// Paths that only documents and trees of files ask for.

/** The manifest: everything begins with it. */
export const manifestPath = 'manifest.json';
/** Where every entry is, with its digest. */
export const indexPath = 'index.bin';
/** Bytes and dssim of fragments, by plane. */
export const tablesPath = 'tables.bin';
/** The texture planes. */
export const texturesPath = 'textures.json';
/** Measured SSIM by scale and texture quality. */
export const qualityPath = 'quality.json';
/** How the package was made. */
export const provenancePath = 'provenance.json';
/** What only the thesis's policy reads. */
export const thesisPath = 'thesis.bin';
/** Notes at points of the object. */
export const annotationsPath = 'annotations.json';
/** What the object is, whose it is, what its coordinates mean. */
export const aboutPath = 'about.json';
/** Path of a scale's GLB, as mesh/s07.glb. */
export const meshPath = (scale: number): string => `mesh/s${String(scale).padStart(2, '0')}.glb`;
/** Path of a proxy, as proxies/00.glb; 0 = the smallest. */
export const proxyPath = (proxy: number): string => `proxies/${String(proxy).padStart(2, '0')}.glb`;

/** Path of a plane's table streams, as texture/3/tables.pack. */
export const tableStreamsPath = (plane: number): string => `texture/${plane}/tables.pack`;
/** The plane that an entry's page in the index belongs to; -1 = none. */
export function planeOfPath(path: string): number {
  const match = /^texture\/(0|[1-9]\d*)\/(tables\.pack|r\d\d+(\.pack|\/\d{4,}\.(jpg|webp)))$/.exec(path);
  return match ? Number(match[1]) : -1;
}
/** Path of a fragment's file, as texture/3/r07/0123.jpg; `unpack --fragments files` makes them. */
export const fragmentFilePath = (plane: number, rung: number, fragment: number, extension: string): string =>
  `texture/${plane}/r${String(rung).padStart(2, '0')}/${String(fragment).padStart(4, '0')}.${extension}`;

/** Whether a path is relative, of a-z 0-9 . _ - and /, without empty parts, "." and "..". */
export function isValidEntryPath(path: string): boolean {
  return (
    path.length <= 200 &&
    path.split('/').every((part) => /^[a-z0-9._-]+$/.test(part) && part !== '.' && part !== '..')
  );
}
