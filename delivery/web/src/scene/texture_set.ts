import { Texture, WebGLRenderer } from 'three';
import type { PlaneChoice } from '../decide/fragment_list';
import type { TextureInfo } from '../format/textures';
import { sleepS } from '../http/clock';
import type { WorkerPool } from '../worker/pool';
import type { Levels } from '../worker/protocol';
import { PlaneComposer, planeComposer } from './composer';
import type { Enqueue } from './enlarge';
import { gpuIdle } from './gpu';
import { MaterialSet, Slot, disposeTexture, texturesIn } from './scale_parts';

/** Milliseconds and pixels of uploads between two turns of the page. */
const sliceMs = 5;
const slicePx = 1 << 19;
/**
 * Slices that the GPU may be behind: an upload beyond what it takes at a time would wait in the middle of a page's turn. It is not
 * waited for longer than longestFenceS.
 */
const mostBehind = 3;
const longestFenceS = 0.25;
/** The smallest mip levels follow this often while fragments come. */
const mipsEveryMs = 200;

/** Nothing but the processor draws: what a GPU does at once takes it seconds, and workers less. */
async function isSoftware(renderer: WebGLRenderer): Promise<boolean> {
  await gpuIdle(renderer);
  const gl = renderer.getContext();
  const info = gl.getExtension('WEBGL_debug_renderer_info');
  const name = String(gl.getParameter(info ? info.UNMASKED_RENDERER_WEBGL : gl.RENDERER));
  return /swiftshader|llvmpipe|softpipe|software|basic render/i.test(name);
}

/** The composed textures of a model, one per image (and one for its alpha), and the uploads to them. */
export type TextureSet = ReturnType<typeof textureSet>;

/** For the textures of a package in these materials. */
export function textureSet(renderer: WebGLRenderer, textures: readonly TextureInfo[], materials: MaterialSet, pool: WorkerPool) {
  const planes = new Map<number, PlaneComposer>(); // by full-size plane
  const queue: { pixels: number; run(): void; ended(): void }[] = [];
  let pending = 0;
  let pumping = false;
  let disposed = false;
  let mipsAt = 0;
  let pixels = 0; // since the last of the fences that the GPU may not have passed
  const behind: Promise<void>[] = [];
  const software = isSoftware(renderer); // once, and soon: a GPU that has something to draw keeps the page waiting for its name

  /** Where materials that are there show this plane: coverage beside the colours that it belongs to, where they ask for it. */
  function slotsOf(base: number): Slot[] {
    const { image, role } = textures[base];
    const slots = materials.slots.filter((s) => s.image === image);
    if (role !== 'alpha') return slots;
    const covered = slots.filter(({ name, material: m }) => name === 'map' && (m.transparent || m.alphaTest > 0));
    return covered.map((s) => ({ ...s, name: 'alphaMap' }));
  }
  const textureAt = ({ material, name }: Slot): Texture => (texturesIn(material)[name] ?? texturesIn(material).map)!;
  /** Materials get views of a plane, those that came meanwhile or with a later scale, too. */
  function dress(plane: PlaneComposer): void {
    for (const slot of slotsOf(plane.base)) {
      const old = textureAt(slot);
      if (plane.textures.includes(old)) continue;
      const shown = texturesIn(slot.material);
      if (!shown[slot.name]) slot.material.needsUpdate = true;
      shown[slot.name] = plane.view(old);
    }
  }
  async function fill(next: PlaneComposer, before?: PlaneComposer, old?: Texture, preview?: ImageBitmap): Promise<void> {
    const image = preview ?? (old?.image as ImageBitmap | null | undefined);
    if (before?.filled) next.fill(before.textures[0]);
    else if (image?.width)
      try {
        // A preview of its own is that of coverage, beside which the colours are shown.
        if (preview || (await software)) await (await import('./enlarge')).enlarge(next, image, { pool, enqueue, ended: () => disposed });
        else next.fill(old!);
      } catch (error) {
        // A browser whose workers cannot draw leaves it to the GPU.
        if (preview || disposed) throw error;
        next.fill(old!);
      }
    next.filled = true;
  }
  /** All mip levels of everything, at once. */
  function finish(): void {
    mipsAt = performance.now();
    planes.forEach((plane) => plane.updateMips());
  }
  const enqueue: Enqueue = (pixels, run) =>
    new Promise((ended) => {
      queue.push({ pixels, run, ended });
      if (!pumping) void pump();
    });
  async function pump(): Promise<void> {
    pumping = true;
    for (await sleepS(0); queue.length > 0; await sleepS(0)) {
      const start = performance.now();
      while (queue.length > 0 && pixels < slicePx && performance.now() - start < sliceMs) {
        const work = queue.shift()!;
        pixels += work.pixels;
        if (!disposed) work.run();
        work.ended();
      }
      if (start - mipsAt > mipsEveryMs || queue.length === 0) finish();
      if (pixels < slicePx) continue;
      pixels = 0;
      behind.push(gpuIdle(renderer, longestFenceS));
      if (behind.length > mostBehind) await behind.shift();
    }
    pumping = false;
  }

  return {
    planes,
    /** Fragments that wait to be uploaded. */
    get pending(): number {
      return pending;
    },
    /**
     * Shows a texture by this plane from now on: filled with what was shown so far (or the preview) in small steps, then
     * the materials are changed at once. Resolves when they have been.
     */
    async show({ base, plane }: PlaneChoice, preview?: ImageBitmap): Promise<void> {
      const before = planes.get(base);
      const next = planeComposer(renderer, textures[plane], base, plane);
      const old = slotsOf(base).map(textureAt);
      const shown = old.find((texture) => (texture.image as ImageBitmap | null)?.width);
      next.view(shown ?? old[0] ?? new Texture()); // a finer scale may bring the material that wants it
      planes.set(base, next);
      try {
        await (next.ready = fill(next, before, shown, preview));
      } catch (error) {
        if (before) planes.set(base, before);
        else planes.delete(base);
        next.dispose();
        throw error;
      }
      next.updateMips();
      if (disposed || planes.get(base) !== next) return; // another has taken its place meanwhile
      dress(next);
      if (before) before.dispose();
      else if (textures[base].role !== 'alpha') old.forEach(disposeTexture);
    },
    /** Whether a material that is there shows this plane. */
    isUsed: (base: number): boolean => slotsOf(base).length > 0,
    /** A material has come with a later scale. */
    adopt: (): void => planes.forEach((plane) => plane.filled && dress(plane)),
    /** Queues a fragment; resolves when it is in its texture, or (false) was not better than the rung there by then. */
    async upload(plane: PlaneComposer, levels: Levels, fragment: number, rung: number, better: (there: number) => boolean): Promise<boolean> {
      ++pending;
      plane.come.add(fragment);
      let shown = false;
      await plane.ready!.catch(() => undefined);
      await enqueue(levels[0].width * levels[0].height, () => {
        shown = planes.get(plane.base) === plane && better(plane.rungs[fragment]);
        if (shown) plane.uploadFragment(levels, fragment, rung);
      });
      --pending;
      return shown;
    },
    finish,
    dispose(): void {
      disposed = true;
      planes.forEach((plane) => plane.dispose());
      planes.clear();
    },
  };
}
