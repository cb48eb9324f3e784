import { describe, expect, it } from 'vitest';
import {
  BoxGeometry, BufferGeometry, Float32BufferAttribute, Group, Mesh, PerspectiveCamera,
} from 'three';
import { arWay, sceneViewerAddress } from '../../src/notes/ar';
import type { Manifest } from '../../src/format/manifest';
import type { Point } from '../../src/format/annotations';
import {
  annotationsFile, lengthInWords, lengthOf, nearestOf, pick, placeOf, positionBits,
  readAnnotations, textFor,
} from '../../src/notes';
import { DepthPicture } from '../../src/notes/depth';
import { within } from '../../src/notes/editor';

const near = (found: Point | undefined, expected: Point): void =>
  expected.forEach((x, k) => expect(found![k]).toBeCloseTo(x, 6));

describe('picking', () => {
  const camera = new PerspectiveCamera(90, 1, 0.1, 100);
  camera.position.set(0, 0, 5);
  camera.lookAt(0, 0, 0);
  const object = new Group();
  const box = new Mesh(new BoxGeometry(2, 2, 2));
  object.add(box);

  it('finds the nearest side, in the coordinates of the package, and nothing beside the object', () => {
    near(pick(object, camera, 0, 0)?.position, [0, 0, 1]);
    near(pick(object, camera, 0, 0)?.normal, [0, 0, 1]);
    near(pick(object, camera, 0.1, -0.2)?.position, [0.4, -0.8, 1]);
    expect(pick(object, camera, 0.9, 0)).toBeUndefined();
  });
  it('follows where the object and its parts stand', () => {
    object.position.set(0, 0, -5);
    box.position.set(0, 0, 0.5);
    box.scale.setScalar(2);
    near(pick(object, camera, 0, 0)?.position, [0, 0, 2.5]);
    box.visible = false;
    expect(pick(object, camera, 0, 0)).toBeUndefined();
    object.position.set(0, 0, 0);
    box.position.set(0, 0, 0);
    box.scale.setScalar(1);
    box.visible = true;
  });
  it('sees a point where it was picked, and none behind the camera', () => {
    const { position } = pick(object, camera, 0.1, -0.2)!;
    const at = placeOf(object, camera, position)!;
    expect(at[0]).toBeCloseTo(0.1, 6);
    expect(at[1]).toBeCloseTo(-0.2, 6);
    expect(placeOf(object, camera, [0, 0, 6])).toBeUndefined();
  });
  it('takes nothing for a triangle that is none', () => {
    const of = (from: Point, way: Point, corners: number[]): number => {
      const geometry = new BufferGeometry();
      geometry.setAttribute('position', new Float32BufferAttribute(corners, 3));
      return nearestOf(new Mesh(geometry), from, way).t;
    };
    expect(of([0, 0, 1], [0, 0, -1], [0, 0, 0, 0, 0, 0, 1, 0, 0])).toBe(Infinity);
    expect(of([0, 0, 1], [0, 0, -1], [NaN, 0, 0, 1, 0, 0, 0, 1, 0])).toBe(Infinity);
    expect(of([0.2, 0.2, 1], [0, 0, -1], [0, 0, 0, 1, 0, 0, 0, 1, 0])).toBe(1);
    expect(of([0.2, 0.2, 1], [0, 0, -1], [0, 0, 0, 0, 1, 0, 1, 0, 0])).toBe(1);
    expect(of([0.2, 0.2, 1], [0, 0, 1], [0, 0, 0, 1, 0, 0, 0, 1, 0])).toBe(Infinity);
    expect(of([0.2, 0.2, 1], [0, 0, -1], [0, 0, 0, 1, 0])).toBe(Infinity);
  });
});

describe('what hides a point', () => {
  const camera = new PerspectiveCamera(90, 1, 0.1, 100);
  camera.position.set(0, 0, 5);
  camera.lookAt(0, 0, 0);
  camera.updateMatrixWorld();
  const object = new Group(), wall = new Mesh(new BoxGeometry(2, 2, 0.2));
  wall.position.set(0, 0, 2);
  object.add(new Mesh(new BoxGeometry(2, 2, 2)), wall);
  const hides = (point: Point, off = 0.01): boolean => new DepthPicture(object, camera).hides(point, off);

  it('is whatever stands before it, and not its own surface', () => {
    expect(hides([0, 0, 1])).toBe(true); // faces the camera, behind the wall
    expect(hides([0, 0, 2.1])).toBe(false);
    expect(hides([0.5, 0.5, 2.095])).toBe(false);
    expect(hides([0.5, 0.5, 2.05])).toBe(true);
    expect(hides([0.5, 0.5, 2.05], 0.1)).toBe(false);
    expect(hides([0, 0, -1])).toBe(true);
    expect(hides([3, 0, -1])).toBe(false);
    expect(hides([0, 0, 6])).toBe(false); // behind the camera
  });
  it('is nothing where the object is not shown, or lies about the camera', () => {
    wall.visible = false;
    expect(hides([0, 0, 1])).toBe(false);
    wall.visible = true;
    wall.scale.z = 100; // its sides reach from before the camera to behind it
    expect(hides([0, 0, 1])).toBe(false);
    wall.scale.z = 1;
  });
  it('moves with the object', () => {
    object.rotation.y = Math.PI; // the wall is behind now
    expect(hides([0, 0, -1])).toBe(false);
    expect(hides([0, 0, 1])).toBe(true);
    object.rotation.y = 0;
  });
  it('takes nothing for a triangle that is none', () => {
    const odd = new BufferGeometry();
    odd.setAttribute('position', new Float32BufferAttribute([NaN, 0, 4, 1, 0, 4, 0, 1, 4, 0, 0, 4], 3));
    const broken = new Mesh(odd);
    object.add(broken);
    expect(hides([0, 0, 2.1])).toBe(false);
    object.remove(broken);
  });
});

describe('measuring', () => {
  const scales = [{ scale: 0, errorMax: 0 }, { scale: 3, errorMax: 10 }];
  const manifest = { objectHeight: 65535, scales } as Manifest;

  it('adds up a line, and its error by scale and grid', () => {
    const grid = Math.sqrt(3) / 2;
    expect(lengthOf([[0, 0, 0], [3, 4, 0]], manifest, 0)).toEqual({ length: 5, error: 2 * grid });
    expect(lengthOf([[0, 0, 0], [3, 4, 0], [3, 4, 12]], manifest, 0))
      .toEqual({ length: 17, error: 4 * grid });
    expect(lengthOf([[0, 0, 0], [3, 4, 0]], manifest, 3).error).toBeCloseTo(2 * (10 + grid));
    expect(lengthOf([[0, 0, 0]], manifest, 0)).toEqual({ length: 0, error: 0 });
    // without a scale, as of a proxy: the coarsest
    expect(lengthOf([[0, 0, 0], [3, 4, 0]], manifest, -1).error).toBeCloseTo(2 * (10 + grid));
  });
  it('takes the grid from what the package says of its making', () => {
    const of = (scales: object): number => positionBits({ options: { scales } });
    expect(of({ position_bits: 0, least_position_bits: 12 })).toBe(12);
    expect(of({ position_bits: 14, least_position_bits: 16 })).toBe(14);
    expect(of({ position_bits: 2 })).toBe(6);
    for (const odd of [undefined, null, {}, { options: 1 }, { options: { scales: { position_bits: '9' } } }])
      expect(positionBits(odd)).toBe(16);
    expect(lengthOf([[0, 0, 0], [3, 4, 0]], manifest, 0, 12).error)
      .toBeCloseTo(Math.sqrt(3) * 65535 / 4095);
  });
  it.each([
    [123.4567, 0.04, 0.001, '12.346 cm ± 0.004 cm'],
    [123.4567, 0.9, 0.001, '12.35 cm ± 0.09 cm'],
    [123.4567, 1.01, 0.001, '12.3 cm ± 0.2 cm'],
    [17.178, 0.00975, 0.001, '1.718 cm ± 0.001 cm'],
    [1.5, 0.004, 1, '1.500 m ± 0.004 m'],
    [2500, 3, 1, '2.500 km ± 0.003 km'],
    [0.4, 0.01, 0.001, '0.40 mm ± 0.01 mm'],
    [12, 30, 0.001, '1 cm ± 3 cm'],
    [12.34, 0.1, 0, '12.3 units ± 0.1 units'],
  ])('%d with %d off, %d m a unit: %s', (length, error, metres, words) => {
    expect(lengthInWords({ length, error }, metres)).toBe(words);
  });
});

describe('texts of notes', () => {
  const note = { position: [0, 0, 0] as Point,
    texts: [{ language: 'en', title: 'A' }, { language: 'de-AT', title: 'B' }] };

  it('are in the first language that is there', () => {
    expect(textFor(note, ['de', 'en']).title).toBe('B');
    expect(textFor(note, ['fr', 'en-US']).title).toBe('A');
    expect(textFor(note, ['fr']).title).toBe('A');
    expect(textFor(note, []).title).toBe('A');
  });
  it('become a file that a package could have', () => {
    const file = new TextEncoder().encode(annotationsFile([note]));
    expect(readAnnotations(file)).toEqual([note]);
  });
  it('are cut at whole letters, without line ends', () => {
    expect(within('a\nb', 10)).toBe('a b');
    expect(within('äöü', 4)).toBe('äö');
    expect(within('😀😀', 7)).toBe('😀');
  });
});

describe('AR', () => {
  const glb = 'https://a.b/c.glb', usdz = 'https://a.b/c.usdz', files = { glb, usdz };
  const android = 'Mozilla/5.0 (Linux; Android 14; Pixel 8) AppleWebKit/537.36 Chrome/130 Mobile';
  const iphone = 'Mozilla/5.0 (iPhone; CPU iPhone OS 18_0 like Mac OS X) AppleWebKit/605 Safari/604.1';
  const desktop = 'Mozilla/5.0 (X11; Linux x86_64) Chrome/130';
  const xr = (can: boolean) => ({ isSessionSupported: async () => can });

  it.each([
    [files, { userAgent: android }, 'scene-viewer'],
    [files, { userAgent: android, xr: xr(true) }, 'webxr'],
    [files, { userAgent: android, xr: xr(false) }, 'scene-viewer'],
    [{ usdz }, { userAgent: android, xr: xr(true) }, undefined],
    [files, { userAgent: iphone, hasRelAr: true }, 'quick-look'],
    [files, { userAgent: iphone }, 'quick-look'],
    [{ glb }, { userAgent: iphone, hasRelAr: true }, undefined],
    [files, { userAgent: 'Mozilla/5.0 (Macintosh) Safari', maxTouchPoints: 5 }, 'quick-look'],
    [files, { userAgent: 'Mozilla/5.0 (Macintosh) Safari', maxTouchPoints: 0 }, undefined],
    [files, { userAgent: desktop }, undefined],
    [{}, { userAgent: android, xr: xr(true), hasRelAr: true }, undefined],
  ])('%o in %o: %s', async (have, browser, way) => expect(await arWay(have, browser)).toBe(way));

  it('is not offered where the browser refuses to say', async () => {
    const refuses = { isSessionSupported: () => Promise.reject(new Error('SecurityError')) };
    expect(await arWay(files, { userAgent: desktop, xr: refuses })).toBeUndefined();
  });
  it('opens Scene Viewer by an address that holds the file, encoded', () => {
    const file = { glb: 'https://a.b/c d.glb?x=1&y=2#z', title: 'A & "B"; C' };
    const address = sceneViewerAddress(file, 'https://a.b/#c;d');
    expect(address.startsWith('intent://arvr.google.com/scene-viewer/1.2?file=' +
      'https%3A%2F%2Fa.b%2Fc%20d.glb%3Fx%3D1%26y%3D2%23z&')).toBe(true);
    expect(address.match(/#/g)).toHaveLength(1);
    expect(address).toContain('title=A%20%26%20%22B%22%3B%20C#Intent;scheme=https;');
    expect(address).toContain('S.browser_fallback_url=https%3A%2F%2Fa.b%2F%23c%3Bd;end;');
  });
});
