import type { BlockRequest } from '../blocks/formats';
import { type BytesOf, planesWithin, rgbaBytes, wayWithin } from '../decide/gpu_memory';
import { scaleBytes } from '../decide/gpu_size';
import { TextureLoss, fullSize, planesForDisplay, type PlaneChoice } from '../decide/texture_loss';
import { InputError, throwIfAborted } from '../format/errors';
import { mostPreviewPx } from '../format/layout';
import type { PackageData } from '../format/tables';
import { type TextureInfo } from '../format/textures';
import { nowS } from '../http/requests';
import type { Levels } from '../worker/protocol';
import type { Compression } from './blocks/compression';
import type { PlaneComposer } from './composer';
import type { FragmentPlace } from './fragment_fates';
import { hysteresis, type LoadContext } from './load_context';
import type { ScaleSource } from './scale_source';
import { TextureSet } from './texture_set';

/** The planes for the display, or all at full size where options say so. */
function planesFor({ options, view }: LoadContext, data: PackageData,
    displayedPx = view.display.heightPx): PlaneChoice[] {
  return options.fullSize ? fullSize(data.textures) : planesForDisplay(data, displayedPx);
}

/** The data for decisions about textures: all tables if small or if time matters, else this display's. */
export async function readPlaneData(load: LoadContext, scales: ScaleSource): Promise<PackageData> {
  const { reader, pool, signal } = load;
  pool.start();
  const [whole] = await Promise.all([reader.prefetchDocuments(signal), scales.openStream()]);
  // A short time may ask for coarser planes than the display's, a long one for finer ones.
  if (whole || Number.isFinite(load.limitS)) return reader.data(undefined, signal);
  const base = fullSize(await reader.textures(signal)).map((c) => c.plane);
  const shown = planesFor(load, await reader.data(base, signal)).map((c) => c.plane);
  return reader.data([...base, ...shown], signal);
}

/** Which planes show the textures of a load: choosing them, and showing them. */
export class ShownPlanes {
  private set_: TextureSet;
  private compression_?: Compression;
  private considered_ = false;
  private texelS_ = 0; // seconds that showing planes has taken at most, by their texels
  /** How texels are stored, for the whole load: other texels would have to be fetched again. */
  private way_?: number;

  constructor(
    private readonly load_: LoadContext,
    /** Data with the tables of the planes that are shown, at least. */
    public data: PackageData,
  ) {
    this.set_ = this.newSet_();
  }
  private newSet_(): TextureSet {
    const { options, materials, pool } = this.load_;
    return new TextureSet(options.renderer, this.textures, materials, pool, (plane) => {
      const format = this.compression_?.ways[this.way_ ?? 0](plane);
      return format && [this.compression_!, format];
    });
  }

  get textures(): readonly TextureInfo[] {
    return this.data.textures;
  }
  /** Textures that are being composed. */
  all(): PlaneComposer[] {
    return [...this.set_.planes.values()];
  }
  showing(f: { plane: number }): PlaneComposer | undefined {
    return this.all().find((p) => p.plane === f.plane);
  }
  /** The rung of a fragment in its texture; -1: the preview. */
  rungOf(f: FragmentPlace): number {
    return this.showing(f)?.rungs[f.fragment] ?? -1;
  }
  /** Fragments that wait to be uploaded. */
  get pending(): number {
    return this.set_.pending;
  }
  isUsed(base: number): boolean {
    return this.set_.isUsed(base);
  }
  /** How a worker makes blocks of a fragment. */
  blocksOf(f: FragmentPlace): BlockRequest | undefined {
    const to = this.showing(f);
    return to?.blocks?.request(...to.placeOf(f.fragment));
  }
  readPlane(base: number): Uint8Array | undefined {
    return this.set_.planes.get(base)?.read();
  }
  showInNewMaterials(): void {
    this.set_.showInNewMaterials();
  }
  finishMips(): void {
    this.set_.finishMips();
  }
  upload(to: PlaneComposer, levels: Levels, fragment: number, rung: number,
      better: (there: number) => boolean): Promise<boolean> {
    return this.set_.upload(to, levels, fragment, rung, better);
  }
  /** The GPU has lost everything: nothing goes there until showAnew(). */
  lose(): void {
    this.set_.stop();
  }
  dispose(): void {
    this.set_.dispose();
  }

  // ---- choosing

  /** The planes for the display as it is now. */
  forDisplay(): PlaneChoice[] {
    return planesFor(this.load_, this.data);
  }
  /** Planes that the GPU can hold: a mip of a plane that is too large, or none; within the memory left. */
  fitting(choices: readonly PlaneChoice[], scale: number): PlaneChoice[] {
    const most = this.load_.options.renderer.capabilities.maxTextureSize;
    const fits = (t: TextureInfo): boolean => Math.max(t.widthPx, t.heightPx) <= most;
    return this.withinMemory_(choices, scale).flatMap(({ base, plane }) => {
      // Mips stand in falling order of their size.
      const taken = fits(this.textures[plane]) ? plane
        : this.textures.findIndex((t) => t.mip > 0 && t.base === base && fits(t));
      if (taken >= 0) return [{ base, plane: taken }];
      this.load_.fail(new InputError('GPU', `texture plane ${plane}`, `at most ${most} px`, 'more'),
        'textures');
      return [];
    });
  }
  private withinMemory_(choices: readonly PlaneChoice[], scale: number): readonly PlaneChoice[] {
    if (choices.length === 0) return choices; // which say nothing of how texels fit
    const room = this.room_(scale);
    this.way_ ??= wayWithin(choices, room, this.ways);
    if (room === Infinity) return choices;
    return planesWithin(new TextureLoss(this.data, this.load_.view.display.heightPx), choices, room,
      [this.ways[this.way_]]);
  }
  /** Memory for the textures beside a scale. */
  private room_(scale: number): number {
    const { memoryBytes, reader: { manifest } } = this.load_;
    const mesh = manifest.scales.find((s) => s.scale === scale);
    return memoryBytes - (mesh ? scaleBytes(mesh) : 0);
  }
  /** Ways to store the planes, the best first. */
  get ways(): readonly BytesOf[] {
    return this.compression_?.bytes ?? [rgbaBytes(this.textures)];
  }
  /** Finds out, before planes are chosen, whether they may be blocks: RGBA takes more than there is. */
  async considerCompression(scale: number): Promise<void> {
    const { compress = 'auto' } = this.load_.options;
    const fits = compress === 'auto' &&
      wayWithin(this.forDisplay(), this.room_(scale), [rgbaBytes(this.textures), () => 0]) === 0;
    if (this.considered_ || compress === 'never' || fits) return;
    this.considered_ = true;
    try {
      this.compression_ = await (await import('./blocks/compression')).openCompression(this.load_,
        this.textures);
    } catch (error) {
      this.load_.fail(error, 'compressed textures'); // RGBA it is
    }
  }
  /** Planes with more texels where the view came nearer. Texels that are there stay. */
  finer(scale: number): PlaneChoice[] {
    const { planes } = this.set_;
    const wanted = planesFor(this.load_, this.data, this.load_.view.display.heightPx / hysteresis)
      .filter((c) => planes.has(c.base));
    const larger = (a: number, b: number): number =>
      (this.textures[a].widthPx > this.textures[b].widthPx ? a : b);
    const all = wanted.map(({ base, plane }) => ({ base, plane: larger(plane, planes.get(base)!.plane) }));
    return this.fitting(all, scale)
      .filter((c) => planes.get(c.base)!.widthPx < this.textures[c.plane].widthPx);
  }
  /** The texture that loses most by its plane, and its finest plane that shows within so many seconds. */
  nextFiner(scale: number, withinS: number): PlaneChoice | undefined {
    const { textures, set_: { planes }, data, load_ } = this;
    const loss = new TextureLoss(data, load_.view.display.heightPx);
    const next = this.finer(scale).flatMap(({ base, plane }) => {
      const { plane: shown } = planes.get(base)!;
      // in falling order of their size
      const mips = [...textures.keys()].filter((p) => textures[p].mip > 0 && textures[p].base === base);
      const finest = [base, ...mips].find((p) => textures[p].mip >= textures[plane].mip &&
        this.texelsOf_(p) * this.texelS_ <= withinS);
      return finest !== undefined && textures[finest].mip < textures[shown].mip
        ? [{ base, plane: finest, loss: loss.mip(shown) }] : [];
    });
    return next.sort((a, b) => b.loss - a.loss)[0];
  }
  private texelsOf_(plane: number): number {
    return this.textures[plane].widthPx * this.textures[plane].heightPx;
  }
  /** Reads the tables of these planes, too. */
  async readTables(planes: readonly number[]): Promise<void> {
    const { reader, signal } = this.load_;
    this.data = await reader.data([...this.all().map((p) => p.plane), ...planes], signal);
  }

  // ---- showing

  /**
   * Shows textures by these planes; textures that the first GLB does not have begin with the package's
   * preview. Fragments may come from then on; `shown` resolves when the scene has changed.
   */
  async show(choices: readonly PlaneChoice[], anew = false): Promise<{ shown: Promise<unknown> }> {
    const { load_: { signal }, set_: first } = this;
    const beganS = nowS();
    const shown: Promise<void>[] = [];
    for (const choice of choices) {
      const { base, plane } = choice;
      const { role, widthPx, heightPx } = this.textures[plane];
      // A plane that cannot be shown leaves the picture of the mesh.
      const lostPlane = (error: unknown): void => this.load_.fail(error, `texture plane ${plane}`);
      try {
        const needed = !this.set_.planes.has(base) && (anew || role === 'alpha' || !this.isUsed(base));
        const preview = needed ? await this.previewOf_(base) : undefined;
        throwIfAborted(signal); // after the end of the load nobody would dispose of the plane
        const { set_: set } = this;
        if (set !== first && (anew || set.planes.has(base))) {
          preview?.close(); // lost again meanwhile: whoever made the other set shows all of this
          continue;
        }
        const planeShown = (): void => {
          if (!set.stopped) this.load_.emit('plane', { base, plane, widthPx, heightPx });
        };
        shown.push(set.show(choice, preview).then(planeShown, lostPlane).finally(() => preview?.close()));
      } catch (error) {
        lostPlane(error);
      }
      throwIfAborted(signal);
    }
    const texels = choices.reduce((sum, { plane }) => sum + this.texelsOf_(plane), 0);
    return { shown: Promise.all(shown)
      .then(() => (this.texelS_ = Math.max(this.texelS_, (nowS() - beganS) / texels))) };
  }
  private async previewOf_(base: number): Promise<ImageBitmap> {
    const { reader, pool, signal } = this.load_;
    const streams = [await reader.preview(base, signal)];
    const most: [number, number] = [mostPreviewPx, mostPreviewPx];
    return (await pool.decode({ codec: 'jpeg', tables: new Uint8Array(0), streams, digests: [],
      complete: true, levels: 1, most }))[0] as ImageBitmap;
  }
  /** The GPU has lost everything: these planes begin with their previews. */
  async showAnew(choices: readonly PlaneChoice[]): Promise<void> {
    this.set_.dispose();
    this.set_ = this.newSet_();
    await (await this.show(choices, true)).shown;
  }
}
