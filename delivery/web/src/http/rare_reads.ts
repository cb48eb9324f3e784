import { codecTraits } from '../format/codec';
import { planeOfPath } from '../format/entry_paths';
import { FormatError, InputError } from '../format/errors';
import { joinFragment } from '../format/join_fragment';
import * as layout from '../format/layout';
import type { ByteRange, EntryRef } from '../format/manifest';
import { PackageReader, decodeHere } from './package_reader';
import type { ReadOptions } from './store';
import { fragmentCount, rungCount } from '../format/tables';

// What a PackageReader offers and loads do not ask for, or only where something was damaged on the way; loaded with the first such call.

/** See PackageReader.index. */
export async function readIndex(reader: PackageReader): Promise<EntryRef[]> {
  return decodeHere('readIndex', await reader.readChecked(reader.manifest.index, { kind: 'index' }));
}

/** See PackageReader.find. */
export function find(reader: PackageReader, path: string, signal?: AbortSignal): Promise<EntryRef> {
  return reader.findOn(planeOfPath(path), path, signal);
}

/** See PackageReader.provenance. */
export async function readProvenance(reader: PackageReader): Promise<unknown> {
  return JSON.parse(new TextDecoder().decode(await reader.readChecked(reader.manifest.provenance, { kind: 'other' })));
}

/** See PackageReader.splitStreamHead. */
export async function splitStreamHead(reader: PackageReader, signal?: AbortSignal): Promise<Uint8Array | undefined> {
  return (await reader.splitStreamStart(0, signal))?.subarray(0, reader.manifest.stream!.headBytes);
}

/** See PackageReader.firstPicture. */
export async function readFirstPicture(reader: PackageReader, how: Partial<ReadOptions>): Promise<void> {
  if (reader.form !== 'range') return;
  const { firstPicture, previews } = reader.manifest;
  const got = await reader.readChecked({ path: 'first picture', ...firstPicture }, { kind: 'first-picture', ...how });
  // Its digest covers its parts.
  previews.forEach(({ offset, bytes }, plane) => reader.keepPreview(plane, got.subarray(offset - firstPicture.offset).subarray(0, bytes)));
}

/** See PackageReader.fragmentRange. */
export async function fragmentRange(reader: PackageReader, plane: number, rung: number, fragment: number): Promise<ByteRange> {
  const { tables: t, offsets } = await reader.planeFiles(plane);
  const at = rung * fragmentCount(t) + fragment;
  if (!(rung >= 0 && rung < rungCount(t) && fragment >= 0 && fragment < fragmentCount(t)))
    throw new InputError(reader.store.name, `texture plane ${plane}`, 'a rung and a fragment of it', `${rung}, ${fragment}`);
  return { offset: offsets[at], bytes: t.sizeBytes[at] };
}

/** See PackageReader.fragmentDigest. */
export async function fragmentDigest(reader: PackageReader, plane: number, rung: number, fragment: number): Promise<Uint8Array> {
  const t = await reader.planeTables(plane);
  const at = 8 * (rung * fragmentCount(t) + fragment);
  return t.digest.subarray(at, at + 8);
}

/** See PackageReader.fragment. */
export async function fragment(
  reader: PackageReader,
  plane: number,
  rung: number,
  number: number,
  signal?: AbortSignal,
): Promise<Uint8Array> {
  const { offset, bytes } = await fragmentRange(reader, plane, rung, number);
  const pack = await reader.find(layout.rungPath(plane, rung), signal);
  const path = `fragment ${number} of ${pack.path}`;
  if (bytes === 0) throw new FormatError(reader.store.name, path, 'a stored fragment', 'none');
  const sha256 = await fragmentDigest(reader, plane, rung, number);
  const how = { kind: 'texture', once: reader.form !== 'files', signal } as const;
  return reader.readChecked({ path, offset: pack.offset + offset, bytes, sha256 }, how, pack);
}

/** See PackageReader.completeFragment. */
export async function completeFragment(
  reader: PackageReader,
  plane: number,
  rung: number,
  number: number,
  signal?: AbortSignal,
): Promise<Uint8Array> {
  const { codec } = (await reader.textures(signal))[plane];
  const first = codecTraits(codec).incremental ? 0 : rung;
  const streams: Uint8Array[] = [];
  for (let r = first; r <= rung; ++r) streams.push(await fragment(reader, plane, r, number, signal));
  return joinFragment(codec, await reader.tableStream(plane, first, signal), streams);
}
