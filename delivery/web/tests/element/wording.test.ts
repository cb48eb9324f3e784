import { expect, it } from 'vitest';
import { bytesInWords, degreesOf, numberOf, offerInWords, orbitOf,
  secondsInWords } from '../../src/element/wording';

it('bytes and seconds are said as people read them', () => {
  expect([0, 45056, 999400, 999600, 2.5e6, 12.34e6, -1, NaN].map(bytesInWords))
    .toEqual(['0 kB', '45 kB', '999 kB', '1 MB', '2.5 MB', '12 MB', '', '']);
  expect([0.2, 1.2, 9.4, 12, 31].map(secondsInWords))
    .toEqual(['under a second', 'about 1 s', 'about 9 s', 'about 10 s', 'about 30 s']);
});
it('an offer says no more than is known', () => {
  expect(offerInWords(45056, 0, 0)).toBe('45 kB');
  expect(offerInWords(45056, 2.5e6, 0)).toBe('45 kB; up to 2.5 MB in all');
  expect(offerInWords(45056, 100, 20000)).toBe('45 kB, about 2 s');
});
it('angles are degrees or radians', () => {
  expect([' 30deg', '-.5rad', '1.deg', '0deg'].map((a) => degreesOf(a, 7)))
    .toEqual([30, (-0.5 * 180) / Math.PI, 1, 0]);
  for (const other of [null, undefined, '', 'deg', '30', '30 deg', '3e1deg', '-50%'])
    expect(degreesOf(other, 7)).toBe(7);
});
it('orbits are read as model-viewer writes them; what cannot be read is the default', () => {
  expect(orbitOf(null)).toEqual({ thetaDegrees: 28, phiDegrees: 72, distance: 1 });
  expect(orbitOf('10deg 1rad 105%')).toEqual({ thetaDegrees: 10, phiDegrees: 180 / Math.PI, distance: 1.05 });
  expect(orbitOf('-90deg')).toEqual({ thetaDegrees: -90, phiDegrees: 72, distance: 1 });
  expect(orbitOf('auto 500deg 9m')).toEqual({ thetaDegrees: 28, phiDegrees: 179, distance: 1 });
  expect(orbitOf('0deg 0deg 1e9%').distance).toBe(1);
});
it('numbers stay within their bounds', () => {
  expect([numberOf('7', 1, 0, 9), numberOf('70', 1, 0, 9), numberOf('', 1, 0, 9), numberOf('x', 1, 0, 9),
    numberOf(null, 1, 0, 9)]).toEqual([7, 9, 1, 1, 1]);
});
