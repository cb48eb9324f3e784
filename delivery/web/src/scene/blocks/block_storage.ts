import {
  CompressedTexture, LinearFilter, Mesh, NoBlending, OrthographicCamera, PlaneGeometry, ShaderMaterial,
  type Texture, WebGLRenderTarget, type WebGLRenderer,
} from 'three';
import {
  type BlockFormat, type BlockLevel, type BlockRequest, type Pixels, blockBytes,
} from '../../blocks/formats';
import type { TextureInfo } from '../../format/textures';
import type { Levels } from '../../worker/protocol';
import { GpuStorage, ownLevels } from '../plane_storage';
import { threeFormats } from './gpu_formats';
import { unpacked } from './two_channels';

/** A part of a picture that has, or would have if it were enlarged, a size `of` so many px. */
export interface PicturePart {
  x: number;
  y: number;
  width: number;
  height: number;
  of: [width: number, height: number];
}

/** RGBA bytes of a texture's part, row 0 first: blocks cannot be read, so they are drawn. */
export function readPicture(renderer: WebGLRenderer, texture: Texture, format: BlockFormat | undefined,
    { x, y, width, height, of }: PicturePart): Uint8Array {
  const target = new WebGLRenderTarget(width, height,
    { colorSpace: texture.colorSpace, depthBuffer: false, minFilter: LinearFilter, magFilter: LinearFilter });
  const material = new ShaderMaterial({
    depthTest: false, depthWrite: false, blending: NoBlending, toneMapped: false,
    uniforms: { map: { value: texture },
      place: { value: [x / of[0], y / of[1], width / of[0], height / of[1]] } },
    vertexShader: `varying vec2 at; uniform vec4 place;
      void main() { at = place.xy + uv * place.zw; gl_Position = vec4( position.xy * 2.0, 0.0, 1.0 ); }`,
    fragmentShader: `varying vec2 at; uniform sampler2D map;
      void main() {
        vec4 t = textureLod( map, at, 0.0 ); ${format ? unpacked(format) : ''} gl_FragColor = t;
      }`,
  });
  const square = new Mesh(new PlaneGeometry(1, 1), material);
  square.frustumCulled = false;
  const before = renderer.getRenderTarget();
  const pixels = new Uint8Array(4 * width * height);
  renderer.setRenderTarget(target);
  renderer.render(square, new OrthographicCamera());
  renderer.readRenderTargetPixels(target, 0, 0, width, height, pixels);
  renderer.setRenderTarget(before);
  square.geometry.dispose();
  material.dispose();
  target.dispose();
  return pixels;
}

/** Texels of an upload: a megabyte at most, so that none takes more than a slice of a page's turn. */
const bandPx = 1 << 18;

/** An upload, which gives so many pixels to the GPU. */
export interface Upload {
  pixels: number;
  run(): void;
}
/** What a storage asks of the load. */
export interface BlockHost {
  /** Makes blocks in a worker. */
  encode(picture: Pixels, request: BlockRequest): Promise<Levels>;
  /** Queues an upload. */
  enqueue(upload: Upload): Promise<void>;
  /** Counts what is under way. */
  pending(by: 1 | -1): void;
  blocksUrl: string;
}

/** Levels whose fragments begin and end with a block. */
function alignedLevels({ fragmentWidthPx: width, fragmentHeightPx: height }: TextureInfo): number {
  let levels = 0;
  while (levels < ownLevels && (width >> levels) % 4 === 0 && (height >> levels) % 4 === 0) ++levels;
  return levels;
}

/** PlaneStorage of blocks. The smallest levels are made of a copy of the largest one of them. */
export class BlockStorage extends GpuStorage<CompressedTexture> {
  /** Levels that fragments bring as blocks. */
  readonly own: number;
  private readonly tail_: Pixels; // level `own`
  private stale_ = false;
  private making_?: Promise<void>;
  private disposed_ = false;

  constructor(
    renderer: WebGLRenderer,
    info: TextureInfo,
    readonly format: BlockFormat,
    private readonly host_: BlockHost,
    /** Fills a new storage with the picture of the others. */
    private readonly refill_: (from: Texture) => void,
  ) {
    super(renderer, info);
    this.own = alignedLevels(info);
    const [width, height] = [this.side_(info.widthPx, this.own), this.side_(info.heightPx, this.own)];
    this.tail_ = { width, height, pixels: new Uint8Array(4 * width * height) };
  }

  /** How a worker makes blocks of a picture whose place is x, y. */
  request(x: number, y: number): BlockRequest {
    const { widthPx, heightPx } = this.info_;
    return { url: this.host_.blocksUrl, format: this.format, own: this.own,
      size: [widthPx - x, heightPx - y] };
  }
  /** See PlaneComposer.view. */
  view(old: Texture, filled: boolean): Texture {
    const known = this.views_.get(old);
    if (known) return known;
    const { widthPx, heightPx, colourSpace } = this.info_;
    const levelCount = this.levelsFor_(old);
    const mipmaps = Array.from({ length: levelCount }, (_, level) => ({ width: this.side_(widthPx, level),
      height: this.side_(heightPx, level), data: null as never }));
    const texture = new CompressedTexture(mipmaps, widthPx, heightPx, threeFormats[this.format]);
    const { format, type, image, source } = texture;
    const first = this.textures[0];
    texture.copy(old as CompressedTexture);
    Object.assign(texture, { format, type, mipmaps, source: first?.source ?? source,
      colorSpace: colourSpace === 'srgb' ? 'srgb' : '', flipY: false, generateMipmaps: false });
    if (!first) Object.assign(texture, { image });
    texture.source.dataReady = false; // three.js makes the storage, and nothing else
    texture.needsUpdate = true;
    const storage = this.storageOf_(texture);
    this.views_.set(old, texture);
    if (this.storages_.has(storage)) return texture;
    this.storages_.set(storage, levelCount);
    if (first && filled) this.refill_(first);
    return texture;
  }
  /** The uploads of levels at a place of level 0. */
  uploads(levels: Levels, x: number, y: number): Upload[] {
    const uploads: Upload[] = [];
    (levels as BlockLevel[]).forEach((part, level) => {
      const [left, top] = [x >> level, y >> level];
      if (level === this.own) uploads.push({ pixels: 0, run: () => this.keep_(part, left, top) });
      else uploads.push(...this.bands_(part, level, left, top));
    });
    return uploads;
  }
  /** The smallest levels follow the uploads, when a worker has made them. */
  updateMips(): void {
    if (!this.stale_ || this.making_ || ![...this.storages_.values()].some((levels) => levels > this.own))
      return;
    this.making_ = this.makeTail_().finally(() => (this.making_ = undefined));
  }
  /** Resolves when the smallest levels have followed. */
  async settled(): Promise<void> {
    for (this.updateMips(); this.making_; this.updateMips()) await this.making_;
  }
  /** RGBA bytes, row 0 at the top. */
  read(): Uint8Array {
    const { widthPx, heightPx } = this.info_;
    return readPicture(this.renderer_, this.textures[0], this.format,
      { x: 0, y: 0, width: widthPx, height: heightPx, of: [widthPx, heightPx] });
  }
  override dispose(): void {
    this.disposed_ = true;
    super.dispose();
  }

  /** A level in rows of blocks, a band at a time. */
  private bands_({ width, height, data }: BlockLevel, level: number, left: number, top: number): Upload[] {
    const rows = Math.max(4, Math.floor(bandPx / width) & ~3);
    const rowBytes = Math.ceil(width / 4) * blockBytes(this.format);
    return Array.from({ length: Math.ceil(height / rows) }, (_, i) => {
      const [from, to] = [i * rows, Math.min((i + 1) * rows, height)];
      const bytes = data.subarray((from / 4) * rowBytes, Math.ceil(to / 4) * rowBytes);
      return { pixels: width * (to - from),
        run: () => this.write_(level, left, top + from, width, to - from, bytes) };
    });
  }
  private write_(level: number, x: number, y: number, width: number, height: number,
      bytes: Uint8Array): void {
    const { gl_: gl } = this;
    for (const [storage, levelCount] of this.storages_) {
      if (level >= levelCount) continue;
      this.renderer_.state.bindTexture(gl.TEXTURE_2D, storage);
      gl.pixelStorei(gl.UNPACK_FLIP_Y_WEBGL, 0);
      gl.compressedTexSubImage2D(gl.TEXTURE_2D, level, x, y, width, height, this.glFormat_(), bytes);
    }
  }
  private glFormat_(): number {
    const srgb = this.info_.colourSpace === 'srgb';
    return { bc1: srgb ? 0x8c4c : 0x83f0, 'bc3-normal': 0x83f3, bc5: 0x8dbd, bc7: srgb ? 0x8e8d : 0x8e8c,
      etc2: srgb ? 0x9275 : 0x9274, astc: srgb ? 0x93d0 : 0x93b0, 'astc-normal': 0x93b0 }[this.format];
  }
  private keep_({ width, height, data }: BlockLevel, left: number, top: number): void {
    const to = this.tail_;
    const columns = Math.min(width, to.width - left);
    for (let row = 0; row < Math.min(height, to.height - top); ++row)
      if (columns > 0) to.pixels.set(data.subarray(4 * width * row, 4 * (width * row + columns)),
        4 * (to.width * (top + row) + left));
    this.stale_ = true;
  }
  private async makeTail_(): Promise<void> {
    this.stale_ = false;
    this.host_.pending(1);
    try {
      const levels = await this.host_.encode({ ...this.tail_, pixels: this.tail_.pixels.slice() },
        { ...this.request(0, 0), own: Infinity, size: [Infinity, Infinity] });
      for (const [i, level] of (levels as BlockLevel[]).entries())
        for (const upload of this.bands_(level, this.own + i, 0, 0)) if (!this.disposed_)
          await this.host_.enqueue(upload);
    } catch {
      // The smallest levels stay as they were until the next uploads.
    }
    this.host_.pending(-1);
  }
}
