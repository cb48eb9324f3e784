import { type Annotation, annotationLimits } from '../format/annotations';
import { type NotesLayer, make } from './layer';
import { onPlaces } from './placing';
import { annotationsFile, textFor } from './texts';

/** Hands a text to whoever sits before the screen, as a file. Nothing is sent anywhere. */
export function saveFile(name: string, text: string, type = 'application/json'): void {
  const link = make('a', { download: name, href: URL.createObjectURL(new Blob([text], { type })) });
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 60_000);
}

/** At most so many bytes of UTF-8, of whole characters and without control characters. */
export function within(text: string, bytes: number): string {
  let out = '', used = 0;
  for (const letter of text.replace(/[\u0000-\u001f\u007f]+/g, ' ')) {
    used += new TextEncoder().encode(letter).length;
    if (used > bytes) break;
    out += letter;
  }
  return out;
}

/** A curator's tools in the layer: places notes, changes their words, saves annotations.json. */
export function edit(layer: NotesLayer): () => void {
  const { words, languages } = layer;
  const language = languages[0] ?? 'en';
  const tools = make('div', { class: 'line' });
  const fields = (note: Annotation, card: HTMLElement): void => {
    const text = textFor(note, languages);
    const field = (name: 'title' | 'text', most: number): HTMLElement => {
      const input = make(name === 'title' ? 'input' : 'textarea', { 'aria-label': words[name],
        placeholder: words[name] });
      input.value = text[name] ?? '';
      input.addEventListener('input', () => {
        text[name] = within(input.value, most);
        if (name === 'text') return;
        layer.show();
        card.querySelector('h3')!.textContent = `${layer.notes.indexOf(note) + 1}. ${text.title}`;
      });
      return input;
    };
    const remove = make('button', {}, words.remove, () => {
      layer.notes.splice(layer.notes.indexOf(note), 1);
      layer.close();
      layer.show();
    });
    card.prepend(field('title', annotationLimits.title), field('text', annotationLimits.text), remove);
  };
  layer.edit = fields;
  const save = make('button', {}, words.save, () =>
    layer.notes.length > 0 && saveFile('annotations.json', annotationsFile(layer.notes)));
  tools.append(make('span', {}, `${words.addHelp} `), save);
  layer.root.append(tools);
  const end = onPlaces(layer, ({ position, normal }) => {
    if (layer.notes.length >= annotationLimits.notes) return;
    const { camera } = layer.stage, object = layer.stage.load()!.object;
    const eye = object.worldToLocal(camera.position.clone()).toArray();
    layer.notes.push({ position, normal, texts: [{ language, title: '' }],
      camera: { position: eye, target: position, fovDegrees: camera.fov } });
    layer.show();
    layer.open(layer.notes.length - 1, false);
    layer.card.querySelector('input')?.focus();
  });
  return () => {
    end();
    tools.remove();
    layer.edit = undefined;
  };
}
