// What WebGL is asked to store, counted in the page; a GPU that holds no more than a test says, or has no other formats.

/**
 * Runs in the page before anything else. `storedBytes()` sums what textures and buffers take; `gpuBytesLimit`, set by a test, makes calls that
 * would store more fail as a GPU without memory fails: nothing is stored, and getError says OUT_OF_MEMORY once.
 */
export function countStorage() {
  window.stored = new Map();
  window.gpuBytesLimit = Infinity;
  window.refusals = 0;
  // Bytes of a block of 4 x 4 texels: BC1 and ETC2 of three channels 8, other BC and ASTC 16; other formats are RGBA.
  const blocks = {0x83f0: 8, 0x8c4c: 8, 0x9274: 8, 0x9275: 8, 0x83f3: 16, 0x8dbd: 16, 0x8e8c: 16, 0x8e8d: 16, 0x93b0: 16, 0x93d0: 16};
  const ofLevel = (format, w, h) => (blocks[format] ? blocks[format] * Math.ceil(w / 4) * Math.ceil(h / 4) : 4 * w * h);
  const sizeOf = (levels, format, w, h) => Array.from({length: levels}, (_, l) => ofLevel(format, Math.max(1, w >> l), Math.max(1, h >> l))).reduce((a, b) => a + b, 0);
  const proto = WebGL2RenderingContext.prototype;
  let bound;
  let refused = false;
  const wrap = (name, call) => { const own = proto[name]; proto[name] = function (...a) { return call(() => own.apply(this, a), ...a); }; };
  const store = (object, bytes, go) => {
    const before = window.stored.get(object) ?? 0;
    if (window.storedBytes() - before + bytes > window.gpuBytesLimit) {
      ++window.refusals;
      refused = true;
      return undefined;
    }
    window.stored.set(object, bytes);
    return go();
  };
  wrap('bindTexture', (go, _, t) => { bound = t; go(); });
  wrap('texStorage2D', (go, _, levels, format, w, h) => store(bound, sizeOf(levels, format, w, h), go));
  wrap('deleteTexture', (go, t) => { window.stored.delete(t); go(); });
  const buffers = new Map();
  wrap('bindBuffer', (go, target, b) => { buffers.set(target, b); go(); });
  wrap('bufferData', (go, target, data) => store(buffers.get(target), data.byteLength ?? data, go));
  wrap('deleteBuffer', (go, b) => { window.stored.delete(b); go(); });
  wrap('getError', (go) => {
    const said = refused ? 0x0505 : go();
    refused = false;
    return said;
  });
  const canvasOf = HTMLCanvasElement.prototype.getContext;
  HTMLCanvasElement.prototype.getContext = function (kind, ...rest) {
    const context = canvasOf.call(this, kind, ...rest);
    if (/webgl/.test(kind)) {
      window.contexts = (window.contexts ?? new Set()).add(context);
      this.addEventListener('webglcontextlost', () => window.stored.clear());
    }
    return context;
  };
  window.storedBytes = () => [...window.stored.values()].reduce((a, b) => a + b, 0);
}

/** Runs in the page before the library: a GPU that has no other compressed formats than these. */
export function onlyFormats(names) {
  const own = WebGL2RenderingContext.prototype.getExtension;
  WebGL2RenderingContext.prototype.getExtension = function (name) {
    return /compress/.test(name) && !names.some((n) => name.endsWith(n)) ? null : own.call(this, name);
  };
}
