// What <texmesh-viewer> loads where a package has notes, or where an attribute asks for more.

import type { Orbit } from '../page/framing';
import type { PageModel } from '../page/page_model';
import type { Point } from '../format/annotations';
import { readNotes } from './read';
import { type ArFiles, arButton, arWay } from './ar';
import { edit } from './editor';
import { NotesLayer, make } from './layer';
import { measure } from './measuring';
import { apply } from './pick';

const style = `
.ar { position: absolute; right: .5rem; bottom: 2rem; width: 44px; height: 44px; padding: 6px;
  box-sizing: border-box;  border: 0; border-radius: .5rem; background: #fffffff0; pointer-events: auto; }
.ar img { display: block; width: 100%; height: 100%; }
.tools { position: absolute; left: .5rem; top: .5rem; }`;

/** The orbit of a camera at a place, as the page's framing counts it. */
export function orbitAt([x, y, z]: Point, model: PageModel): Orbit {
  const { boundsMin, boundsMax } = model.package!.manifest, { camera } = model;
  const from = [x, y, z].map((p, k) => p - (boundsMin[k] + boundsMax[k]) / 2);
  const away = Math.max(Math.hypot(...from), 1e-9);
  const radius = Math.max(Math.hypot(...boundsMax.map((p, k) => p - boundsMin[k])) / 2, 1e-9);
  const narrow = Math.atan(Math.tan((camera.fov * Math.PI) / 360) * Math.min(1, camera.aspect));
  const degrees = 180 / Math.PI;
  return { thetaDegrees: Math.atan2(from[0], from[2]) * degrees,
    phiDegrees: Math.acos(from[1] / away) * degrees, distance: (away * Math.sin(narrow)) / radius };
}

/** Puts the camera at a place, in the coordinates of the package's meshes. */
function look(model: PageModel, position: Point, target: Point): void {
  const { camera, load } = model;
  const world = load!.object.matrixWorld, at = apply(world, position), to = apply(world, target);
  const { boundsMin, boundsMax } = model.package!.manifest;
  const diagonal = Math.hypot(...boundsMax.map((p, k) => p - boundsMin[k]));
  const away = Math.hypot(...at.map((p, k) => p - to[k]));
  camera.position.set(...at);
  camera.lookAt(...to);
  camera.near = Math.max(away, 1e-9) / 500;
  camera.far = away + 4 * diagonal;
  camera.updateProjectionMatrix();
  camera.updateMatrixWorld();
  model.moved();
}

/** Adds a button that is on or off. */
function toggle(tools: HTMLElement, words: string, begin: () => () => void): () => void {
  let end: (() => void) | undefined;
  const button = make('button', { 'aria-pressed': 'false' }, words, () => {
    end = end ? void end() : begin();
    button.setAttribute('aria-pressed', String(!!end));
  });
  tools.append(button, ' ');
  return () => end?.();
}

/**
 * Notes of the package; by the attributes `measure`, `annotate` and `ar` (with `ar-src`, a GLB, and
 * `ios-src`, a USDZ) what they say. `turned` hears of the orbit of each view that notes choose. Gives what
 * takes all away.
 */
export async function attach(element: HTMLElement, root: ShadowRoot, model: PageModel,
    turned: (orbit: Orbit) => void): Promise<() => void> {
  const language = element.closest<HTMLElement>('[lang]')?.lang;
  const languages = [...(language ? [language] : []), ...navigator.languages];
  const pkg = model.package!;
  const [notes, about] = await Promise.all([readNotes(pkg).catch((error: unknown) => {
    console.error('<texmesh-viewer>: notes:', error);
    return [];
  }), pkg.about()]);
  const layer = new NotesLayer({
    canvas: model.canvas, camera: model.camera, manifest: pkg.manifest, load: () => model.load,
    look: (position, target) => {
      look(model, position, target);
      turned(orbitAt(model.camera.position.toArray(), model));
    },
  }, notes, languages);
  const tools = make('div', { class: 'tools' });
  layer.root.append(make('style', {}, style), tools);
  const ends = [() => layer.dispose()];
  if (element.hasAttribute('measure'))
    ends.push(toggle(tools, layer.words.measure, () => measure(layer, pkg, about)));
  if (element.hasAttribute('annotate')) ends.push(toggle(tools, layer.words.add, () => edit(layer)));
  const address = (name: string): string | undefined => {
    const said = element.getAttribute(name);
    return said ? new URL(said, document.baseURI).href : undefined;
  };
  const files: ArFiles = { glb: address('ar-src'), usdz: address('ios-src'), title: about.title };
  const way = element.hasAttribute('ar') ? await arWay(files) : undefined;
  if (way) layer.root.append(arButton(way, files, layer.words.ar));
  root.append(layer.root);
  return () => ends.forEach((end) => end());
}
