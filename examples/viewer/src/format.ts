/** Numbers as people read them. */

export function bytes(n: number): string {
  if (!Number.isFinite(n)) return '–';
  if (n < 1000) return `${n.toFixed(0)} B`;
  const units = ['kB', 'MB', 'GB', 'TB'];
  let value = n / 1000;
  let unit = 0;
  while (value >= 999.5 && unit < units.length - 1) {
    value /= 1000;
    unit++;
  }
  return `${value < 10 ? value.toFixed(1) : value.toFixed(0)} ${units[unit]}`;
}

export function seconds(s: number): string {
  if (!Number.isFinite(s)) return 'no limit';
  if (s < 0.9995) return `${(s * 1000).toFixed(0)} ms`;
  return `${s < 10 ? s.toFixed(2) : s.toFixed(1)} s`;
}

export function count(n: number): string {
  return n.toLocaleString('en').replaceAll(',', '\u202f');
}

/** Three digits: 150000 -> 150k. */
export function short(n: number): string {
  if (n >= 9.995e5) return `${Number((n / 1e6).toPrecision(3))}M`;
  if (n >= 1000) return `${Number((n / 1000).toPrecision(3))}k`;
  return String(Math.round(n));
}

export function px(n: number): string {
  return n >= 1e8 ? 'any size' : `${count(Math.round(n))} px`;
}
