// A static server for tests, in this process: with or without ranges, and wrong where a test asks for it.
import fs from 'node:fs';
import http from 'node:http';
import path from 'node:path';
import zlib from 'node:zlib';

const kTypes = {
  '.html': 'text/html; charset=utf-8', '.js': 'text/javascript; charset=utf-8', '.mjs': 'text/javascript; charset=utf-8', '.css': 'text/css; charset=utf-8',
  '.json': 'application/json', '.svg': 'image/svg+xml', '.wasm': 'application/wasm', '.jpg': 'image/jpeg',
  '.webp': 'image/webp', '.png': 'image/png', '.glb': 'model/gltf-binary', '.texmesh': 'application/vnd.texmesh+zip',
};

/** [first, end) of a Range header, null for none, 'bad' for one behind the end. */
function requestedRange(header, size) {
  const m = /^bytes=(\d*)-(\d*)$/.exec(header ?? '');
  if (!m || (!m[1] && !m[2])) return null;
  const first = m[1] ? +m[1] : Math.max(0, size - +m[2]);
  const end = m[1] && m[2] ? Math.min(size, +m[2] + 1) : size;
  return first >= size ? 'bad' : [first, end];
}

/**
 * Serves the folders of `roots` ({'/prefix/': folder}) on loopback. Every request is kept in `requests` as {method, path, range,
 * status, bytes}; `fault(request)` may return what goes wrong with one: {status}, {flip: byte of the body}, {cut: bytes after which
 * the connection ends}, {stall: bytes after which nothing more comes}, {delay: ms}, {gzip: true}: compressed, also parts. `policy`: the pages' Content-Security-Policy. `gzip`: scripts and
 * pages are packed, as most servers pack them.
 */
export async function serve(roots, {ranges = true, fault = () => undefined, cors = true, policy = '', gzip = false} = {}) {
  const requests = [];
  const sockets = new Set();
  const state = {fault};
  const find = (url) => {
    for (const [prefix, folder] of Object.entries(roots)) {
      if (!url.startsWith(prefix)) continue;
      const file = path.join(folder, url.slice(prefix.length) || 'index.html');
      if (file.startsWith(folder) && fs.existsSync(file) && fs.statSync(file).isFile()) return file;
    }
    return null;
  };
  const server = http.createServer(async (request, response) => {
    let url = request.url.split('?')[0];
    try {
      url = decodeURIComponent(url);
    } catch { /* broken escapes: a file of that name, which is not there */ }
    const record = {method: request.method, path: url, range: request.headers.range, at: performance.now(), status: 0, bytes: 0};
    requests.push(record);
    const wrong = state.fault(record) ?? {};
    if (wrong.delay) await new Promise((done) => setTimeout(done, wrong.delay));
    const headers = cors ? {
      'Access-Control-Allow-Origin': '*',
      'Access-Control-Expose-Headers': 'Content-Range, Content-Length, ETag, Accept-Ranges',
      'Access-Control-Allow-Headers': 'Range, If-Range, If-None-Match',
    } : {};
    const end = (status, body = '') => {
      record.status = status;
      response.writeHead(status, headers);
      response.end(body);
    };
    if (request.method === 'OPTIONS') return end(204);
    const file = find(url);
    if (wrong.status) return end(wrong.status, 'wrong on purpose');
    if (!file) return end(404, 'not found');
    const stat = fs.statSync(file);
    const etag = `"${stat.size.toString(16)}-${Math.floor(stat.mtimeMs).toString(16)}"`;
    const mayRange = ranges && (!request.headers['if-range'] || request.headers['if-range'] === etag);
    const range = mayRange ? requestedRange(request.headers.range, stat.size) : null;
    if (range === 'bad') {
      headers['Content-Range'] = `bytes */${stat.size}`;
      return end(416);
    }
    const [first, last] = range ?? [0, stat.size];
    let body = Buffer.alloc(last - first);
    const fd = fs.openSync(file);
    fs.readSync(fd, body, 0, body.length, first);
    fs.closeSync(fd);
    if (wrong.flip !== undefined) body[wrong.flip % body.length] ^= 0x40;
    record.status = range ? 206 : 200;
    Object.assign(headers, {
      'Content-Type': kTypes[path.extname(file)] ?? 'application/octet-stream', 'Content-Length': body.length, ETag: etag,
      // Pages and decoders are kept as everywhere; packages are not, so that every load shows on the line.
      'Cache-Control': /packages|figures|data/.test(url) ? 'no-store' : 'max-age=600',
    });
    if (wrong.gzip || (gzip && !range && /\.(js|mjs|html|css|wasm)$/.test(url))) {
      body = zlib.gzipSync(body);
      Object.assign(headers, {'Content-Encoding': 'gzip', 'Content-Length': body.length});
    }
    if (policy && url.endsWith('.html')) headers['Content-Security-Policy'] = policy;
    if (range) headers['Content-Range'] = `bytes ${first}-${last - 1}/${stat.size}`;
    if (ranges) headers['Accept-Ranges'] = 'bytes';
    response.writeHead(record.status, headers);
    const limit = wrong.cut ?? wrong.stall;
    record.bytes = limit === undefined ? body.length : Math.min(limit, body.length);
    if (request.method === 'HEAD') return response.end();
    if (limit === undefined) return response.end(body);
    response.write(body.subarray(0, record.bytes), () => {
      if (wrong.cut !== undefined) request.socket.destroy();
    });
  });
  server.on('connection', (socket) => {
    sockets.add(socket);
    socket.on('close', () => sockets.delete(socket));
  });
  await new Promise((done) => server.listen(0, '127.0.0.1', done));
  const port = server.address().port;
  return {
    port, requests, url: `http://127.0.0.1:${port}`,
    setFault: (f) => { state.fault = f; },
    /** Ends as a server dies: open connections break, new ones are refused. */
    async close() {
      for (const socket of sockets) socket.destroy();
      await new Promise((done) => server.close(done));
    },
  };
}
