import { toHex } from '../format/bytes';
import { FormatError } from '../format/errors';
import { sha256 } from '../format/sha256';
import { SplitStreamReader } from '../format/splits/split_stream';
import { PackageSource } from './container';
import { Cursor, requireRule } from './fields';
import { ofJson } from './json';
import { Model, previewPath, proxyPath, scalePath } from './model';
import { DecodePicture, requirePicture, requireSource, segmentsOf } from './pictures';
import { follow } from './rules';
import { Dict, Mismatch, Numbers, Value, bytesOf, dictOf, item, listOf, numberOf, textOf } from './values';

const numberAt = (of: Value, name: string): number => numberOf(item(of, name));

/** What a checker looks at beside what opening a package shows: every entry, GLBs, heads of JPEGs, thesis.bin, the stream. */
class Checks {
  private readonly known_: { m: Dict; textures: Value };
  constructor(
    private readonly model_: Model,
    private readonly decode_?: DecodePicture,
  ) {
    this.known_ = { m: model_.manifest, textures: model_.textures };
  }
  async run(): Promise<void> {
    const model = this.model_;
    const { m } = this.known_;
    for (const path of model.entries.paths) await model.entry(path);
    follow('quality', { q: await model.document('quality.json', 4 << 20, 'quality'), ...this.known_ });
    follow('about', { about: await model.document('about.json', 262144, 'about', ['source']), m });
    await model.document('provenance.json', 64 << 20);
    if (m.has('thesis')) this.checkThesis_(new Cursor(await model.entry('thesis.bin'), 'O04', 'thesis.bin'));
    const poster = m.get('poster');
    if (poster) await this.picture_('poster.jpg', { width: numberAt(poster, 'widthPx'), height: numberAt(poster, 'heightPx'), channels: 3 }, 'O01');
    for (const [plane, t] of model.textures.entries()) await this.checkPlane_(plane, t);
    const proxies = m.has('proxies') ? listOf(item(item(m, 'proxies'), 'triangles')) : [];
    for (const [k, triangles] of proxies.entries()) {
      const name = proxyPath(k);
      follow('proxy', { g: (await this.glb_(name)).gltf, name, triangles });
    }
    const materials = await this.checkScales_();
    if (m.has('stream')) await this.checkStream_(dictOf(item(m, 'stream')), Math.max(1, materials));
  }
  private async picture_(path: string, wanted: { width: number; height: number; channels?: number }, rule: string): Promise<void> {
    await requirePicture(await this.model_.entry(path), wanted, rule, path, this.decode_);
  }

  private segments_(data: Uint8Array, what: string): Dict {
    const segments: Dict = segmentsOf(data, what);
    follow('JPEG', { segments });
    return segments;
  }
  private async checkPlane_(plane: number, t: Dict): Promise<void> {
    const model = this.model_;
    const channels = numberAt(t, 'channels');
    if (!t.has('mip')) {
      const path = previewPath(plane);
      this.segments_(await model.entry(path), path);
      await this.picture_(path, { width: numberAt(t, 'previewWidthPx'), height: numberAt(t, 'previewHeightPx'), channels }, 'F16');
    }
    const source = t.get('source');
    if (source && source !== 'exr') {
      const path = `source/${String(plane).padStart(3, '0')}.${textOf(source)}`;
      requireSource(await model.entry(path), source === 'tif', { width: numberAt(t, 'widthPx'), height: numberAt(t, 'heightPx') }, path);
    }
    const heads = await model.pack(plane, 'tables', 'R12', listOf(item(model.tables[plane], 'tables')) as number[]);
    const segments = heads.filter((head) => head.length > 0).map((head) => this.segments_(head, `table stream of plane ${plane}`));
    if (t.get('sourceRung')) follow('source rung', { t, segments });
    await this.checkFragments_(plane, t, heads);
  }
  private async checkFragments_(plane: number, t: Dict, heads: readonly Uint8Array[]): Promise<void> {
    const wanted = { width: numberAt(t, 'fragmentWidthPx'), height: numberAt(t, 'fragmentHeightPx'), channels: numberAt(t, 'channels') };
    const isIncremental = numberAt(this.model_.tables[plane], 'flags') % 2 === 1;
    let below: Uint8Array[][] = [];
    for (const rung of listOf(item(t, 'rungQuality')).keys()) {
      const streams = await this.model_.streams(plane, rung);
      below = streams.map((stream, k) => [...(isIncremental ? (below[k] ?? []) : []), stream]);
      for (const [k, parts] of below.entries()) {
        const what = `fragment ${k} of the order at rung ${rung} of plane ${plane}`;
        const { file } = Object.fromEntries(follow('fragment', { head: heads[isIncremental ? 0 : rung], parts, t }));
        await requirePicture(bytesOf(file), wanted, 'F08', what, this.decode_);
      }
    }
  }

  private checkThesis_(c: Cursor): void {
    const { model_: model } = this;
    const names = { ...this.known_, tables: model.tables, planes: model.textures.length, later: model.isLater };
    const sections = item(follow('thesis', names, c), 'sections') as Numbers;
    for (const [kind, plane, size] of listOf(sections).map((row) => listOf(row) as number[])) {
      const body = new Cursor(c.raw(size), 'O05', `section ${kind} of plane ${plane}`);
      if (kind < 1 || kind > 4) continue;
      follow(`thesis ${kind}`, { plane, ...names }, body);
      body.finish();
    }
    c.finish();
  }

  /** The JSON of a GLB, and its embedded JPEGs by name. */
  private async glb_(path: string): Promise<{ gltf: Dict; pictures: Dict }> {
    const data = await this.model_.entry(path);
    const head = follow('GLB', { whole: data.length }, new Cursor(data, 'G01', path));
    let gltf: Value = null;
    try {
      gltf = ofJson(JSON.parse(new TextDecoder('utf-8', { fatal: true }).decode(bytesOf(item(head, 'text')))));
    } catch (error) {
      throw new FormatError('', path, 'JSON', String(error), 'G01');
    }
    requireRule(gltf instanceof Map, 'G01', path, 'an object');
    const pictures: Dict = new Map();
    for (const image of listOf(gltf.get('images') ?? []).map(dictOf)) {
      if (image.get('mimeType') !== 'image/jpeg' || !image.has('bufferView')) continue;
      const view = dictOf(item(item(gltf, 'bufferViews'), item(image, 'bufferView')));
      const begin = 28 + numberAt(head, 'size') + numberOf(view.get('byteOffset') ?? 0); // behind the head of the binary chunk
      pictures.set(textOf(image.get('name') ?? ''), data.subarray(begin, begin + numberAt(view, 'byteLength')));
    }
    return { gltf, pictures };
  }
  /** Number of materials. */
  private async checkScales_(): Promise<number> {
    const model = this.model_;
    const previews: Dict = new Map();
    for (const [plane, t] of model.textures.entries())
      if (!t.has('mip') && t.get('role') !== 'alpha') previews.set(`texture/${numberAt(t, 'image')}`, await model.entry(previewPath(plane)));
    let first: Dict | undefined;
    for (const [k, scale] of (listOf(item(item(this.known_.m, 'scales'), 'scale')) as number[]).entries()) {
      const path = scalePath(scale);
      if (!model.index.has(path)) continue;
      const { gltf, pictures } = await this.glb_(path);
      first ??= gltf;
      follow('scale', { g: gltf, k, pictures, first, previews, ...this.known_ });
    }
    return listOf(first?.get('materials') ?? []).length;
  }
  private async checkStream_(told: Dict, materials: number): Promise<void> {
    const data = await this.model_.entry('mesh/stream.bin');
    const headBytes = numberAt(told, 'headBytes');
    const splits = new SplitStreamReader(data);
    const { head } = splits;
    requireRule(head.bytes === headBytes, 'S08', 'the head of the stream', 'headBytes');
    requireRule(toHex(await sha256(data.subarray(0, headBytes))) === item(told, 'headSha256'), 'R02', 'the stream', 'headSha256');
    requireRule(head.groups.every(({ material }) => material < materials), 'S23', 'the stream', `${materials} materials`);
    let at = headBytes;
    for (const s of head.scales) {
      const end = headBytes + head.blocks.slice(0, s.blocks).reduce((sum, block) => sum + block.bytes, 0);
      await splits.addBlocks(data.subarray(at, end));
      at = end;
      const found = new Map<string, Value>([['scale', s.scale], ['wedges', s.wedges], ['triangles', s.triangles], ['bytes', end]]);
      follow('streamed scale', { end: found, data, m: this.known_.m });
    }
    requireRule(at === data.length, 'S08', 'the stream', 'the last block at the end');
  }
}

/** See verifyPackage(). */
export async function checkPackage(source: PackageSource, decode?: DecodePicture): Promise<void> {
  try {
    await new Checks(await Model.open(source), decode).run();
  } catch (error) {
    if (!(error instanceof Mismatch || error instanceof TypeError || error instanceof RangeError)) throw error;
    throw new FormatError('', '', 'a package', String(error), 'J04'); // a field is missing, or of another type
  }
}
