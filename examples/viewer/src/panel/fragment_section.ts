import type { TextureInfo } from 'texmesh';
import { make } from '../dom';
import type { Live } from '../live';
import { FragmentMap } from './fragment_map';
import type { ColourBy } from './fragment_map';
import { foldingSection } from './section';

const kColourings: [ColourBy, string][] =
  [['rung', 'rung'], ['eta', 'η'], ['bytes', 'bytes'], ['skipped', 'skipped']];

/** The map of a texture's fragments, with the choice of the texture and of what colours mean. */
export class FragmentSection {
  readonly box: HTMLDetailsElement;
  private readonly textureSelect = make('select', { 'aria-label': 'Texture' });
  private readonly colourings = make('div', { class: 'segments', role: 'group', 'aria-label': 'Colour by' });
  private readonly map = new FragmentMap();
  private colourBy: ColourBy = 'rung';
  private textureChosen = false;

  /** Calls `onTexture` when a person has chosen a texture. */
  constructor(private readonly live: () => Live, onTexture: () => void) {
    for (const [by, text] of kColourings) {
      const button = make('button', { type: 'button', 'aria-pressed': String(by === this.colourBy),
        onclick: () => this.choose(by, button) }, text);
      this.colourings.append(button);
    }
    this.textureSelect.addEventListener('change', () => {
      this.textureChosen = true;
      onTexture();
    });
    this.box = foldingSection('Fragments', 'The texture as it is cut; each fragment in the colour of ' +
      'its quality, importance, bytes, or of being left out.', true,
      this.textureSelect, this.colourings, this.map.box);
  }

  /** The texture plane that the map shows. */
  get plane(): number {
    return Number(this.textureSelect.value) || 0;
  }

  /** How many textures are offered. */
  get textureCount(): number {
    return this.textureSelect.options.length;
  }

  /** Offers the textures of a package. */
  offer(textures: readonly TextureInfo[]): void {
    this.textureSelect.replaceChildren(...textures.map((t, plane) => {
      const image = t.mip > 0 ? textures[t.base] : t;
      const size = `${t.widthPx} × ${t.heightPx}`;
      return make('option', { value: String(plane) },
        `${image?.role ?? t.role} ${t.image}, ${size}${t.mip ? ` (1/${2 ** t.mip})` : ''}`);
    }));
  }

  /** Selects the plane that the scene shows, until a person has chosen one. */
  followScene(): void {
    if (this.textureChosen) return;
    const { shownPlane, textures } = this.live();
    const shown = [...shownPlane].sort(([a], [b]) => a - b);
    // The base colour, where there is one: people call that the texture.
    const [, plane] = shown.find(([base]) => textures[base]?.role === 'base-colour') ?? shown[0] ?? [];
    if (plane !== undefined && this.textureCount > plane) this.textureSelect.value = String(plane);
  }

  /** Draws the map, where the section is open. */
  draw(): void {
    if (this.box.open) this.show();
  }

  private choose(by: ColourBy, button: HTMLButtonElement): void {
    this.colourBy = by;
    for (const b of this.colourings.children) b.setAttribute('aria-pressed', String(b === button));
    this.show();
  }

  private show(): void {
    this.map.show(this.live(), this.plane, this.colourBy);
  }
}
