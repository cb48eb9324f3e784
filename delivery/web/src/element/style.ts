/** Looks of the element; applications change them by parts, slots and the custom properties. */
export const style = `
:host { display: block; position: relative; width: 300px; height: 300px; contain: content; color-scheme: light dark;
  --texmesh-text: light-dark(#1c1c1c, #f2f2f2); --texmesh-panel: light-dark(rgb(255 255 255 / .88), rgb(24 24 24 / .88)); --texmesh-accent: light-dark(#0b57a4, #8ec5ff); }
:host([hidden]) { display: none; }
canvas, .poster { position: absolute; inset: 0; width: 100%; height: 100%; }
canvas { outline-offset: -3px; cursor: grab; touch-action: pan-y; }
canvas:active { cursor: grabbing; }
:host(:not([camera-controls])) canvas { cursor: default; touch-action: auto; }
:focus-visible { outline: 3px solid var(--texmesh-accent); }
.poster { pointer-events: none; }
.poster.fades { transition: opacity .15s; }
.poster img, ::slotted([slot=poster]) { width: 100%; height: 100%; object-fit: contain; }
.poster.gone { opacity: 0; }
.bar { position: absolute; left: 0; top: 0; height: 3px; background: var(--texmesh-accent); }
.box { position: absolute; left: 0; right: 0; margin: 0 auto; top: 50%; transform: translateY(-50%); width: fit-content; max-width: 94%; max-height: 100%; overflow: auto; box-sizing: border-box; padding: .6em 1em; border: 0; border-radius: .5em;
  font: inherit; text-align: center; color: var(--texmesh-text); background: var(--texmesh-panel); overflow-wrap: anywhere; }
.box small { display: block; }
.box[hidden] { display: none; }
button { cursor: pointer; min-height: 44px; }
.box button { font: inherit; color: var(--texmesh-accent); background: none; border: 1px solid; border-radius: .4em; margin-top: .5em; padding: 0 1em; }
.rights { position: absolute; right: 0; bottom: 0; max-width: 100%; box-sizing: border-box; padding: .15em .5em; font-size: 12px; color: var(--texmesh-text); background: var(--texmesh-panel); }
.note { position: absolute; left: 0; top: 3px; max-width: 100%; box-sizing: border-box; padding: .15em .5em; font-size: 12px; color: var(--texmesh-text); background: var(--texmesh-panel); }
.note[hidden] { display: none; }
.rights:empty { display: none; }
.rights a { color: inherit; }
.help { position: absolute; width: 1px; height: 1px; overflow: hidden; clip-path: inset(50%); }
:host([disable-zoom]) .help span { display: none; }
@media (prefers-reduced-motion: reduce) { .poster.fades { transition: none; } }
`;
