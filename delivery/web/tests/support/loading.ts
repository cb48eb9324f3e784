import { BoxGeometry, BufferGeometry, Group, Mesh, MeshStandardMaterial, Scene, Texture, type Vector2,
  WebGLRenderer } from 'three';
import { samePrefix, sha256 } from '../../src/format/sha256';
import type { LoadEvents, LoadOptions, LoadedModel } from '../../src/scene/api';
import { FormatError, TexmeshPackage } from '../../src/open';
import type { OpenOptions } from '../../src/reader';
import { handle } from '../../src/worker';
import type { WorkerRequest } from '../../src/worker/protocol';
import { FakeServer } from './fake_server';

// Whole loads without a GPU: a context that takes everything, pictures that are only bytes.

/** What was uploaded, in its order: the first bytes of the stream. */
export type Uploads = string[];

export function fakeRenderer(uploads: Uploads): WebGLRenderer {
  const textures = new Map<Texture, { __webglTexture: object }>();
  const gl = new Proxy({} as Record<string, unknown>, {
    get: (_, name: string) => {
      if (name === name.toUpperCase()) return name;
      if (name === 'getParameter') return () => 'SwiftShader';
      if (name === 'texSubImage2D')
        return (...args: unknown[]) => args[1] === 0 && uploads.push((args[8] as { tag: string }).tag);
      return () => null;
    },
  });
  const of = (texture: Texture): { __webglTexture: object } => {
    if (!textures.has(texture)) textures.set(texture, { __webglTexture: {} });
    return textures.get(texture)!;
  };
  return {
    getContext: () => gl, initTexture: of, properties: { get: of }, state: { bindTexture: () => undefined },
    capabilities: { maxTextureSize: 1 << 14 }, compile: () => undefined,
    getDrawingBufferSize: (v: Vector2) => v.set(1000, 1000),
  } as unknown as WebGLRenderer;
}

/** A scene with one mesh that shows all images, whatever the bytes are. */
export function fakeGltf(geometry: BufferGeometry = new BoxGeometry()): unknown {
  const picture = (image: number): Texture => Object.assign(new Texture(), { name: `texture/${image}` });
  const material =
    new MeshStandardMaterial({ map: picture(0), roughnessMap: picture(1), normalMap: picture(2) });
  return {
    scene: new Group().add(new Mesh(geometry, material)),
    parser: {
      json: { materials: [{}] },
      associations: new Map([[material, { materials: 0 }]]),
      getDependency: () => Promise.resolve(material),
      assignFinalMaterial: () => undefined,
    },
  };
}

/** Instead of workers: checks digests, decodes nothing. */
export async function decodeNothing(request: WorkerRequest): Promise<[unknown, Transferable[]]> {
  if (request.op !== 'decode') return handle(request);
  for (const [i, digest] of request.digests.entries())
    if (!samePrefix(await sha256(request.streams[i]), digest))
      throw new FormatError('fragment', '', 'a digest', 'another');
  const tag = request.streams.map((s) => `${s.length}`).join();
  return [[{ width: 16, height: 16, close: () => undefined, tag }], []];
}

export interface Loading {
  pkg: TexmeshPackage;
  model: LoadedModel;
  uploads: Uploads;
  /** Names and values of all events, in their order. */
  events: { [K in keyof LoadEvents]: { name: K; event: LoadEvents[K] } }[keyof LoadEvents][];
  count(name: keyof LoadEvents): number;
  dispose(): void;
}

/** Opens and loads a package of a fake server; `opened` may change what its manifest says. */
export async function loading(url: string, server: FakeServer, load: Partial<LoadOptions> = {},
    open: OpenOptions = {}, opened: (pkg: TexmeshPackage) => void = () => undefined): Promise<Loading> {
  const pkg = await TexmeshPackage.openUrl(url,
    { fetch: server.fetch, startBytes: 16384, retries: 0, retryDelayS: 0.001, ...open });
  opened(pkg);
  const uploads: Uploads = [];
  const model = pkg.load(new Scene(), {
    renderer: fakeRenderer(uploads),
    gltfLoader: () => ({ register: () => undefined, parseAsync: () => Promise.resolve(fakeGltf()) }),
    decode: decodeNothing, meshes: 'glb', time: Infinity, display: 4000, ...load,
  });
  const events: Loading['events'] = [];
  const names: (keyof LoadEvents)[] = ['request', 'first-picture', 'proxy', 'scale', 'plane', 'fragment',
    'decision', 'deadline', 'error', 'done'];
  for (const name of names)
    model.on(name, (event) => events.push({ name, event } as Loading['events'][number]));
  return { pkg, model, uploads, events, count: (name) => events.filter((e) => e.name === name).length,
    dispose: () => pkg.dispose() };
}

/** Until it is so, or for some seconds. */
export async function until(so: () => boolean, mostS = 8): Promise<boolean> {
  for (const end = performance.now() + 1000 * mostS; !so() && performance.now() < end; )
    await new Promise((go) => setTimeout(go, 5));
  return so();
}
