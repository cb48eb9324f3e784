import { expect, it } from 'vitest';
import { type PagePlace, byInterest, defaultMemoryBytes, leastS, linkBytesS, shareOf,
  turnS } from '../../src/page/schedule';
import type { RequestRecord } from '../../src/http/requests';

const place = (p: Partial<PagePlace>): PagePlace =>
  ({ visible: true, regarded: false, areaPx: 100, distancePx: 0, ...p });
const record = (firstByte: number, ended: number, received: number): RequestRecord =>
  ({ url: '', offset: 0, bytes: received, received, kind: 'texture', started: firstByte - 0.1, firstByte,
    ended, status: 206, ok: true });

it('what the user looks at comes first, then what is seen, by size and by place', () => {
  const places = [place({ visible: false, areaPx: 900 }), place({ distancePx: 5 }), place({}),
    place({ areaPx: 200 }), place({ visible: false, regarded: true })];
  expect([...places].sort(byInterest)).toEqual([4, 3, 2, 1, 0].map((i) => places[i]));
});
it('time is shared by area, and what one leaves the others have', () => {
  expect(shareOf(1, [1, 3])).toBe(0.25);
  expect(shareOf(0, [0, 0])).toBe(0.5);
  expect(turnS(4, 1, [1, 3], 0.1)).toBe(1);
  expect(turnS(4, 3, [3], 0.1)).toBe(4);
  expect(turnS(0.2, 1, [1, 3], 0.1)).toBe(0.1);
  expect(turnS(-1, 3, [3], 0.1)).toBe(0);
  expect(turnS(Infinity, 1, [1, 3], 0.1)).toBe(Infinity);
  expect(turnS(0.2, 1, [1], 0.25)).toBe(0); // it would end too late, whatever it did
  expect(leastS(50000, 500000, 0.05)).toBe(0.2);
  expect(leastS(0, 500000, 0.05)).toBe(0.1);
  expect(leastS(50000, 0, 0.2)).toBe(0.4);
});
it('the link is what came while something came, whatever came at once', () => {
  expect(linkBytesS([], 10)).toBe(0);
  expect(linkBytesS([record(1, 2, 1000)], 2)).toBe(1000);
  expect(linkBytesS([record(1, 2, 1000), record(1.5, 2.5, 500), record(4, 5, 1000)], 5)).toBe(1000);
  expect(linkBytesS([record(1, 5, 400), record(2, 3, 400)], 5)).toBe(200); // one within the other
  // what was long ago does not count
  expect(linkBytesS([record(1, 2, 9000), record(20, 21, 1000)], 21)).toBe(1000);
  expect(linkBytesS([{ ...record(1, 2, 0), firstByte: -1 }], 2)).toBe(0);
});
it('memory is by the device where it says so, else by screen and touch', () => {
  expect(defaultMemoryBytes({ deviceMemoryGb: 8, screenPx: 1, touch: true })).toBe(512e6);
  expect(defaultMemoryBytes({ deviceMemoryGb: 64, screenPx: 1, touch: true })).toBe(512e6);
  expect(defaultMemoryBytes({ deviceMemoryGb: 1, screenPx: 1e7, touch: false })).toBe(64e6);
  expect(defaultMemoryBytes({ screenPx: 2e6, touch: true })).toBe(128e6);
  expect(defaultMemoryBytes({ screenPx: 5e5, touch: false })).toBe(128e6);
  expect(defaultMemoryBytes({ screenPx: 2e6, touch: false })).toBe(256e6);
});
