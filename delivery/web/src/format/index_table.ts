import { BytesIn, readEntryStart } from './bytes_in';
import * as paths from './entry_paths';
import { FormatError } from './errors';
import { EntryRef, formatMinor } from './manifest';
import { requireDigest } from './sha256';
import { noIndex } from './shared_numbers';

const file = paths.indexPath;

/** One page of index.bin: the entries of a plane, or (plane -1) of none. */
export interface IndexPage {
  plane: number;
  entries: number;
  /** Offset within index.bin. */
  offset: number;
  bytes: number;
  sha256: Uint8Array;
}
/** Head of index.bin: places and digests of the pages. */
export interface IndexHead {
  minor: number;
  bytes: number;
  pages: IndexPage[];
}

/** Head of index.bin (format/SPEC.md, section 6); the bytes may stop after it. */
export function readIndexHead(bytes: Uint8Array): IndexHead {
  const input = new BytesIn(bytes, file, 'I03');
  const minor = readEntryStart(input, 'TXMX', 'I01');
  const pageCount = input.u32();
  const entryCount = input.u32();
  if (pageCount === 0 || pageCount > input.left / 44) input.fail('fewer pages', pageCount);
  const head: IndexHead = { minor, bytes: 16 + pageCount * 44, pages: [] };
  let offset = head.bytes;
  let entries = 0;
  for (let i = 0; i < pageCount; ++i) {
    const plane = input.u32();
    const before = i > 1 ? head.pages[i - 1].plane : -1;
    if (i === 0 ? plane !== noIndex : plane === noIndex || plane <= before)
      input.fail('rising planes', plane, 'I02');
    const page: IndexPage = {
      plane: i === 0 ? -1 : plane,
      entries: input.u32(),
      offset,
      bytes: input.u32(),
      sha256: input.raw(32),
    };
    if (page.entries > page.bytes / 49) input.fail('fewer entries', page.entries, 'I04');
    offset += page.bytes;
    entries += page.entries;
    head.pages.push(page);
  }
  if (entries !== entryCount) input.fail(`${entryCount} entries`, entries);
  return head;
}

function checkOrder(entries: EntryRef[]): void {
  const paths = new Set<string>();
  entries.forEach((e, i) => {
    if (paths.has(e.path)) throw new FormatError(file, e.path, 'each path once', '', 'I07');
    paths.add(e.path);
    const before = entries[i - 1];
    if (before && e.offset <= before.offset + before.bytes)
      throw new FormatError(file, e.path, 'rising offsets', `${e.offset}`, 'I07');
  });
}

function readRecord(input: BytesIn, plane: number): EntryRef {
  const offset = input.u64();
  const bytes = input.u64();
  const digest = input.raw(32);
  const path = input.text(input.u8());
  if (!paths.isValidEntryPath(path) || path === paths.manifestPath || path === paths.indexPath)
    input.fail('a path of an entry', path, 'I06');
  if (offset % 64 !== 0 || offset === 0) input.fail('a multiple of 64', offset, 'I05');
  if (paths.planeOfPath(path) !== plane) input.fail('entries of the plane', path, 'I06');
  return { path, offset, bytes, sha256: digest };
}

/** The entries of a page, in container order. The caller has checked the digest. */
export function parseIndexPage(bytes: Uint8Array, plane: number, count: number, minor: number): EntryRef[] {
  const input = new BytesIn(bytes, `${file}: page of plane ${plane}`, 'I04');
  const entries: EntryRef[] = [];
  for (let i = 0; i < count; ++i) entries.push(readRecord(input, plane));
  if (minor <= formatMinor) input.finish();
  checkOrder(entries);
  return entries;
}

/** One page's entries, in container order; its digest is checked. */
export async function readIndexPage(head: IndexHead, page: number, bytes: Uint8Array): Promise<EntryRef[]> {
  const p = head.pages[page];
  const place = `page ${page}`;
  if (bytes.length !== p.bytes)
    throw new FormatError(file, place, `${p.bytes} bytes`, `${bytes.length}`, 'I03');
  await requireDigest(bytes, p.sha256, file, place, 'I04');
  return parseIndexPage(bytes, p.plane, p.entries, head.minor);
}

/** All pages, merged into container order. */
export async function readIndex(bytes: Uint8Array): Promise<EntryRef[]> {
  const head = readIndexHead(bytes);
  const last = head.pages[head.pages.length - 1];
  if (last.offset + last.bytes !== bytes.length)
    throw new FormatError(file, '', `${last.offset + last.bytes} bytes`, `${bytes.length}`, 'I03');
  const pages = await Promise.all(head.pages.map((p, i) =>
    readIndexPage(head, i, bytes.subarray(p.offset, p.offset + p.bytes))));
  const entries = pages.flat().sort((a, b) => a.offset - b.offset);
  checkOrder(entries);
  return entries;
}
