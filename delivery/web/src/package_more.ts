import { codecTraits } from './codec';
import { requireDigest } from './digests';
import { FormatError, InputError } from './errors';
import { joinFragment } from './join_fragment';
import * as layout from './layout';
import type { ByteRange, EntryRef } from './manifest';
import type { PackageReader } from './package_reader';
import type { ReadOptions } from './store';
import { fragmentCount, rungCount } from './tables';

// What a PackageReader offers and loads do not ask for, or only where something was damaged on the way; loaded with the first such call.

/** See PackageReader.firstPicture. */
export async function readFirstPicture({ form, manifest, store }: PackageReader, how: Partial<ReadOptions>): Promise<void> {
  if (form !== 'range') return;
  const { offset, bytes, sha256: digest } = manifest.firstPicture;
  const verify = (got: Uint8Array): Promise<void> => requireDigest(got, digest, store.name, 'first picture');
  await store.read({ path: 'first picture', offset, bytes }, 0, bytes, { kind: 'first-picture', ...how, verify });
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
  const pack: EntryRef = await reader.find(layout.rungPath(plane, rung), signal);
  const { form, store } = reader;
  const place = `fragment ${number} of ${pack.path}`;
  if (bytes === 0) throw new FormatError(store.name, place, 'a stored fragment', 'none');
  const digest = await fragmentDigest(reader, plane, rung, number);
  const verify = (got: Uint8Array): Promise<void> => requireDigest(got, digest, store.name, place);
  return store.read(pack, offset, bytes, { kind: 'texture', once: form !== 'files', signal, verify });
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
