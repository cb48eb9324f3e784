import { describe, expect, it } from 'vitest';
import { groupBytes, groupedList, throughputOf } from '../../src/decide/request_groups';
import { setUp, url } from '../support/transferring';

describe('groups', () => {
  it('keep all bytes and losses, and the order of packs', async () => {
    const { list } = await setUp();
    const grouped = groupedList(list, 3000, 40000);
    expect(grouped.offers.length).toBeLessThan(list.offers.length);
    expect(grouped.groups.flat()).toEqual(list.fragments);
    const sum = (offers: { bytes: number[] }[]): number => offers.reduce((n, o) => n + o.bytes[0], 0);
    expect(sum(grouped.offers)).toBe(sum(list.offers));
    for (const g of grouped.groups) expect(new Set(g.map((f) => f.plane)).size).toBe(1);
  });
  it('one each where requests cost nothing, one per plane where only whole rungs come', async () => {
    const { list } = await setUp();
    expect(groupedList(list, 0, 1e5).offers.length).toBe(list.offers.length);
    expect(groupedList(list, Infinity, 1e5).offers.length)
      .toBe(new Set(list.fragments.map((f) => f.plane)).size);
  });
  it('grow with the round trip, but leave enough decisions', () => {
    expect(groupBytes(250e3, 0.04, 4)).toBeCloseTo(6000);
    expect(groupBytes(250e3, 1, 4)).toBeCloseTo((250e3 * 4) / 48);
  });
  it('throughput is bytes over the time in which bytes came', () => {
    const record = { url, offset: 0, bytes: 0, kind: 'mesh', firstByte: 0.1, status: 206, ok: true } as const;
    const requests = [
      { ...record, started: 0, ended: 1.1, received: 100e3 },
      { ...record, started: 0.5, firstByte: 0.6, ended: 1.1, received: 100e3 },
    ];
    expect(throughputOf(requests, 0.1)).toBeCloseTo(200e3);
  });
});
