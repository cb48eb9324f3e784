/**
 * Width and height that a JPEG, PNG or WebP file says it has, before anybody makes room for the picture. 0, 0
 * where the file is none of these, or where decoders may find another frame than this function, behind
 * markers that have no length.
 */
export function imageSize(b: Uint8Array): [number, number] {
  const at = (i: number): number => b[i] ?? 0;
  const be = (i: number): number => at(i) * 256 + at(i + 1);
  const le = (i: number): number => at(i) + at(i + 1) * 256;
  if (be(0) === 0xffd8)
    for (let i = 2; i < b.length && at(i) === 0xff; ) {
      const marker = at(i + 1);
      const length = be(i + 2);
      if (marker === 0xff) ++i;
      else if (marker < 0xc0 || (marker >= 0xd0 && marker <= 0xd9) || length < 2) break;
      else if (marker <= 0xcf && marker !== 0xc4 && marker !== 0xc8 && marker !== 0xcc)
        return [be(i + 7), be(i + 5)];
      else i += 2 + length;
    }
  if (be(0) === 0x8950 && be(12) === 0x4948) return [be(16) * 65536 + be(18), be(20) * 65536 + be(22)];
  if (be(0) !== 0x5249) return [0, 0];
  const kind = String.fromCharCode(...b.subarray(8, 16));
  if (kind === 'WEBPVP8 ') return [le(26) & 0x3fff, le(28) & 0x3fff];
  if (kind === 'WEBPVP8L') return [1 + (le(21) & 0x3fff), 1 + ((le(22) >> 6) | ((at(24) & 15) << 10))];
  if (kind === 'WEBPVP8X') return [1 + le(24) + at(26) * 65536, 1 + le(27) + at(29) * 65536];
  return [0, 0];
}
