import { FormatError } from '../format/errors';
import { Cursor, requireRule } from './fields';
import { constant, follow } from './rules';
import { Dict, Value, contains, dictOf, item, numberOf, textOf } from './values';

/** A package's bytes: those of a container, or the files of a tree by their paths. */
export type PackageSource = Uint8Array | Blob | ReadonlyMap<string, Uint8Array | Blob>;

async function bytesAt(data: Uint8Array | Blob, at: number, count: number): Promise<Uint8Array> {
  if (data instanceof Uint8Array) return data.subarray(at, at + count);
  return new Uint8Array(await data.slice(at, at + count).arrayBuffer());
}
const sizeOf = (data: Uint8Array | Blob): number => (data instanceof Uint8Array ? data.length : data.size);

/** Place, size and CRC-32 (null in a tree) of each entry by its path, as the rules name them. */
function listTree(files: ReadonlyMap<string, Uint8Array | Blob>): Dict {
  const loose = constant('LOOSE') as RegExp;
  const isLoose = new RegExp(`^(?:${loose.source})$`);
  const record = (data: Uint8Array | Blob): Dict => new Map<string, Value>([['data', 0], ['size', sizeOf(data)], ['crc', null]]);
  return new Map([...files].filter(([path]) => !isLoose.test(path)).map(([path, data]) => [path, record(data)]));
}
const of = (record: Dict, name: string): number => numberOf(item(record, name));

/** Every byte of a container outside of entries is what it must be. */
async function listContainer(data: Uint8Array | Blob): Promise<Dict> {
  const size = sizeOf(data);
  const tail = await bytesAt(data, Math.max(0, size - 98), 98);
  const end = follow('end record', {}, new Cursor(tail.subarray(-22), 'K01', 'the end record'));
  const [[entryCount], directoryBytes, directoryAt] = [item(end, 'counts') as number[], of(end, 'size'), of(end, 'at')];
  let last = end;
  const isMarked = String.fromCharCode(...tail.subarray(-42, -38)) === 'PK\u0006\u0007';
  if (entryCount === 0xffff || directoryBytes === 0xffffffff || directoryAt === 0xffffffff || isMarked)
    last = follow('ZIP64 end', { end }, new Cursor(tail.subarray(0, -22), 'K10', 'the ZIP64 end record'));
  const [at, bytes] = [of(last, 'at'), of(last, 'size')];
  requireRule(at + bytes + (last === end ? 22 : 98) === size, 'K01', 'the end', 'no further bytes, and no fewer');
  const directory = new Cursor(await bytesAt(data, at, bytes), 'K01', 'the central directory');
  const entries: Dict = new Map();
  let here = 0;
  for (let left = (item(last, 'counts') as number[])[0]; left > 0; --left) {
    const central = follow('central header', { here, paths: entries }, directory);
    const path = textOf(item(central, 'path'));
    const header = new Cursor(await bytesAt(data, here, 512), 'K01', `the local header of ${path}`);
    const entry = follow('local header', { central, size: item(central, 'size') }, header);
    entries.set(path, entry);
    here = of(entry, 'data') + of(central, 'size');
  }
  directory.finish();
  follow('container', { paths: [...entries.keys()], entries, here, directory: at });
  return entries;
}

let crcTable: Uint32Array | undefined;
function crc32(bytes: Uint8Array): number {
  crcTable ??= Uint32Array.from({ length: 256 }, (_, n) => {
    for (let k = 0; k < 8; ++k) n = n & 1 ? (n >>> 1) ^ 0xedb88320 : n >>> 1;
    return n;
  });
  let crc = -1;
  for (const byte of bytes) crc = crcTable[(crc ^ byte) & 255] ^ (crc >>> 8);
  return ~crc >>> 0;
}

/** A package, container or tree, by its entries. */
export class Entries {
  private constructor(
    private readonly source_: PackageSource,
    readonly of: Dict,
  ) {}
  static async open(source: PackageSource): Promise<Entries> {
    return new Entries(source, source instanceof Map ? listTree(source) : await listContainer(source as Uint8Array | Blob));
  }
  get isTree(): boolean {
    return this.source_ instanceof Map;
  }
  get paths(): string[] {
    return [...this.of.keys()] as string[];
  }
  /** An entry's bytes; CRC-32 checked. */
  async read(path: string): Promise<Uint8Array> {
    requireRule(contains(this.of, path), 'E01', path, 'an entry');
    const entry = dictOf(item(this.of, path));
    const data = this.source_ instanceof Map ? (this.source_.get(path) as Uint8Array | Blob) : (this.source_ as Uint8Array | Blob);
    const bytes = await bytesAt(data, of(entry, 'data'), of(entry, 'size'));
    if (bytes.length !== of(entry, 'size')) throw new FormatError('', path, `${of(entry, 'size')} bytes`, `${bytes.length}`, 'K01');
    const crc = item(entry, 'crc');
    requireRule(crc === null || crc === crc32(bytes), 'K07', path, 'its CRC-32');
    return bytes;
  }
}
