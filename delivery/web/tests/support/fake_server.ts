/** A web server in memory, with the faults that a test asks for. */
export interface Fault {
  /** By number of the request, from 0 on; false: all is well. */
  (request: { number: number; url: string; range?: [number, number] }): FaultKind | false;
}
export type FaultKind = 'status-500' | 'status-404' | 'status-416' | 'refused' | 'cut' | 'stall' | 'short'
  | 'long' | 'whole' | 'whole-other' | 'whole-longer' | 'flip' | 'flip-last' | 'wrong-range' | 'other-etag'
  | 'gzip' | 'gzip-refused' | 'bare' | 'other-file' | 'page' | 'no-total' | 'part' | 'crumb' | 'busy';

export interface FakeServer {
  fetch: typeof fetch;
  log: { url: string; range?: [number, number]; ended: boolean }[];
}

const chunk = 1000;

function abortError(): Error {
  return new DOMException('aborted', 'AbortError');
}

export function fakeServer(files: Record<string, Uint8Array>,
    options: { ranges?: boolean; fault?: Fault } = {}): FakeServer {
  const log: FakeServer['log'] = [];
  const fakeFetch = async (input: RequestInfo | URL, init: RequestInit = {}): Promise<Response> => {
    const url = String(input);
    const header = new Headers(init.headers).get('Range');
    const m = /^bytes=(\d+)-(\d+)$/.exec(header ?? '');
    const range = m ? ([Number(m[1]), Number(m[2])] as [number, number]) : undefined;
    const entry = { url, range, ended: false };
    const number = log.push(entry) - 1;
    await Promise.resolve();
    if (init.signal?.aborted) throw abortError();
    const kind = options.fault?.({ number, url, range }) || undefined;
    const file = files[new URL(url).pathname];
    if (kind === 'refused') throw new TypeError('connection refused');
    if (kind === 'page')
      return new Response('<!doctype html><title>Sign in</title>',
        { headers: { 'Content-Type': 'text/html; charset=utf-8' } });
    if (kind === 'status-500') return new Response('', { status: 500 });
    if (kind === 'busy') return new Response('', { status: 429, headers: { 'Retry-After': '1' } });
    if (kind === 'status-416') return new Response('', { status: 416 });
    if (!file || kind === 'status-404') return new Response('', { status: 404 });
    const headers = new Headers();
    // The length alone tells a file that is longer now.
    if (kind !== 'whole-longer')
      headers.set('ETag', /^(other-|whole-other)/.test(kind ?? '') ? '"other"' : `"${file.length}"`);
    let body = kind === 'whole-longer' ? new Uint8Array([...file, 0]) : file;
    let status = 200;
    if (range && options.ranges !== false && !kind?.startsWith('whole')) {
      if (range[0] >= file.length) return new Response('', { status: 416 });
      const most = kind === 'part' ? 5000 : kind === 'crumb' ? 10 : Infinity;
      const last = Math.min(range[1], file.length - 1, range[0] + most - 1);
      body = file.slice(range[0], last + 1);
      status = 206;
      const shift = kind === 'wrong-range' ? 64 : 0;
      const total = kind === 'no-total' ? '*' : file.length;
      headers.set('Content-Range', `bytes ${range[0] + shift}-${last + shift}/${total}`);
    }
    if (kind === 'flip') {
      body = body.slice();
      body[body.length >> 1] ^= 0x10;
    }
    if (kind === 'flip-last') {
      body = body.slice();
      body[body.length - 1] ^= 0x10;
    }
    if (kind === 'other-file') body = body.map((byte) => byte ^ 0x10);
    // A host that compresses whatever is asked for: a browser refuses the answer to a range, or decodes it.
    if (kind === 'gzip-refused' && range) throw new TypeError('content decoding failed');
    if (kind === 'gzip' || kind === 'gzip-refused') headers.set('Content-Encoding', 'gzip');
    if (kind === 'gzip' && range) body = new Uint8Array(2 * body.length);
    if (kind === 'bare') headers.delete('Content-Range');
    headers.set('Content-Length', String(body.length));
    if (kind === 'short') body = body.subarray(0, body.length - 1);
    if (kind === 'long') body = new Uint8Array([...body, 0]);
    return new Response(stream(body, kind, init.signal ?? undefined, () => (entry.ended = true)),
      { status, headers });
  };
  return { fetch: fakeFetch as typeof fetch, log };
}

function stream(body: Uint8Array, kind: FaultKind | undefined, signal: AbortSignal | undefined,
    ended: () => void) {
  let at = 0;
  const stopAt = kind === 'cut' || kind === 'stall' ? body.length >> 1 : Infinity;
  return new ReadableStream<Uint8Array>({
    start(controller) {
      signal?.addEventListener('abort', () => {
        try {
          controller.error(abortError());
        } catch {
          // it had ended
        }
      });
    },
    async pull(controller) {
      await new Promise((go) => setTimeout(go, 0));
      if (signal?.aborted) return;
      if (at >= stopAt) {
        if (kind === 'cut') controller.error(new TypeError('network error'));
        else await new Promise(() => undefined);
        return;
      }
      const next = Math.min(body.length, at + chunk, stopAt);
      controller.enqueue(body.slice(at, next));
      at = next;
      if (at >= body.length) {
        ended();
        controller.close();
      }
    },
  });
}

/** The tree beside a container: its entries as files beneath a path. */
export function treeFiles(path: string, container: Uint8Array, manifest: Uint8Array,
    entries: readonly { path: string; offset: number; bytes: number }[]): Record<string, Uint8Array> {
  const files: Record<string, Uint8Array> = { [`${path}manifest.json`]: manifest };
  for (const e of entries) files[path + e.path] = container.slice(e.offset, e.offset + e.bytes);
  return files;
}

/** How many bytes were asked for more than once. */
export function bytesAskedTwice(log: FakeServer['log'], url: string): number {
  const asked = new Set<number>();
  let twice = 0;
  for (const { url: u, range } of log) {
    if (u !== url || !range) continue;
    for (let i = range[0]; i <= range[1]; ++i) {
      if (asked.has(i)) ++twice;
      asked.add(i);
    }
  }
  return twice;
}
