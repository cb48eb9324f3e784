import { toHex } from '../format/bytes';
import { sha256 } from '../format/sha256';
import { Entries, PackageSource } from './container';
import { Cursor, requireRule } from './fields';
import { parseDocument } from './json';
import { follow, followSchema } from './rules';
import { Dict, Numbers, Value, bytesOf, dictOf, equal, item, listOf, numberOf, textOf } from './values';

const hex = async (bytes: Uint8Array): Promise<string> => toHex(await sha256(bytes));

/** Pieces of these sizes, one after the other. */
export function cut(data: Uint8Array, sizes: Iterable<number>): Uint8Array[] {
  let at = 0;
  return Array.from(sizes, (size) => data.subarray(at, (at += size)));
}
const padded = (n: number, digits: number): string => String(n).padStart(digits, '0');
export const previewPath = (plane: number): string => `preview/${padded(plane, 3)}.jpg`;
export const scalePath = (scale: number): string => `mesh/s${padded(scale, 2)}.glb`;
export const proxyPath = (k: number): string => `proxies/${padded(k, 2)}.glb`;

/** Pages of the index or sections of the tables, each with what its head says and to be read to its end by `read`. */
async function readPages(data: Uint8Array, m: Dict, name: 'index' | 'tables', [rule, digest, page]: string[], read: (c: Cursor, record: Value[]) => void) {
  const c = new Cursor(data, rule, name);
  const head = follow(name, { m }, c);
  const told = item(m, name);
  const isHead = equal(item(told, 'headBytes'), c.at) && equal(item(told, 'headSha256'), await hex(data.subarray(0, c.at)));
  requireRule(isHead, 'R02', name, 'the head that the manifest names');
  for (const record of listOf(item(head, 'pages')) as Value[][]) {
    const [bytes, sha] = [numberOf(record.at(-2)!), bytesOf(record.at(-1)!)];
    const one = new Cursor(c.raw(bytes), page, name);
    requireRule((await hex(one.data)) === toHex(sha), digest, name, 'the digest of a page');
    read(one, record);
    if (item(item(m, 'version'), 'minor') === 0) one.finish();
  }
  c.finish();
}

/** A package that has been opened: documents, index and tables keep their rules. */
export class Model {
  readonly index: Dict = new Map();
  readonly tables: Dict[] = [];
  textures: Dict[] = [];
  private constructor(
    readonly entries: Entries,
    readonly manifest: Dict,
  ) {}

  static async open(source: PackageSource): Promise<Model> {
    const entries = await Entries.open(source);
    const m = parseDocument(await entries.read('manifest.json'), 16384, 'manifest.json');
    followSchema(m, 'manifest', 'manifest.json');
    follow('manifest', { m });
    const model = new Model(entries, m);
    await model.readIndex_();
    const { index } = model;
    follow('references', { m, index, entries: entries.of, is_tree: entries.isTree });
    model.textures = listOf(item(await model.document('textures.json', 32 << 20, 'textures'), 'textures')).map(dictOf);
    const names = { m, index, textures: model.textures, names: entries.paths, is_tree: entries.isTree };
    follow('planes', names);
    await model.readTables_();
    follow('order', names);
    return model;
  }
  private async readIndex_(): Promise<void> {
    const data = await this.entries.read('index.bin');
    const told = item(this.manifest, 'index');
    requireRule(equal(item(told, 'bytes'), data.length) && equal(item(told, 'sha256'), await hex(data)), 'R03', 'index.bin', 'size and digest');
    await readPages(data, this.manifest, 'index', ['I03', 'I04', 'I04'], (page, [plane, count]) => {
      let end = 0;
      for (let left = numberOf(count); left > 0; --left) {
        const r = follow('index record', { plane, index: this.index, end }, page);
        const [offset, bytes] = [numberOf(item(r, 'offset')), numberOf(item(r, 'bytes'))];
        end = offset + bytes;
        this.index.set(textOf(item(r, 'path')), [offset, bytes, toHex(bytesOf(item(r, 'digest')))]);
      }
    });
  }
  private async readTables_(): Promise<void> {
    const data = await this.entry('tables.bin');
    const [m, later] = [this.manifest, this.isLater];
    await readPages(data, m, 'tables', ['T02', 'T02', 'T03'], (section) => {
      this.tables.push(follow('section', { m, t: this.textures[this.tables.length], later }, section));
    });
  }
  get isLater(): boolean {
    return numberOf(item(item(this.manifest, 'version'), 'minor')) > 0;
  }

  /** An entry's bytes; digest checked. */
  async entry(path: string): Promise<Uint8Array> {
    const data = await this.entries.read(path);
    const known = this.index.get(path);
    requireRule(!known || item(known, 2) === (await hex(data)), 'I08', path, 'the digest of the index');
    return data;
  }
  async document(path: string, most: number, schema?: string, free: readonly string[] = []): Promise<Dict> {
    const document = parseDocument(await this.entry(path), most, path, free);
    if (schema) followSchema(document, schema, path);
    return document;
  }
  /** Pieces of a pack, whose sizes add up to its own. */
  async pack(plane: number, name: string, rule: string, sizes: ArrayLike<number>): Promise<Uint8Array[]> {
    const path = `texture/${plane}/${name}.pack`;
    const data = await this.entry(path);
    requireRule(data.length === Array.from(sizes).reduce((a, b) => a + b, 0), rule, path, 'the sizes of the tables');
    return cut(data, Array.from(sizes));
  }
  /** Streams of a rung, digests checked, in the order of the tables. */
  async streams(plane: number, rung: number): Promise<Uint8Array[]> {
    const table = this.tables[plane];
    const streams = await this.pack(plane, `r${padded(rung, 2)}`, 'R13', (item(item(table, 'sizes'), rung) as Numbers).data);
    const { raw } = item(table, 'digests') as Numbers;
    for (const [k, stream] of streams.entries()) {
      const at = 8 * (rung * streams.length + k);
      requireRule((await hex(stream)).startsWith(toHex(raw.subarray(at, at + 8))), 'F03', `plane ${plane}`, `the digest of a fragment at rung ${rung}`);
    }
    return streams;
  }
}
