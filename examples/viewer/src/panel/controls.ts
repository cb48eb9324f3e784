import type { Manifest, TextureInfo } from 'texmesh';
import { capsWith, kPolicies, kTimes } from '../choices';
import type { Choices } from '../choices';
import { make } from '../dom';
import * as format from '../format';
import { foldingSection } from './section';

export interface ControlActions {
  /** The choices have changed. */
  choose: (choices: Choices) => void;
  reload: () => void;
  refine: () => void;
}

/** Where a person chooses how the package is loaded and what is shown of it. */
export class Controls {
  readonly box: HTMLElement;
  /** What only experts choose, folded unless the address has chosen some of it. */
  readonly experts: HTMLDetailsElement;
  private readonly scaleSelect: HTMLSelectElement;
  private readonly rungSelect: HTMLSelectElement;

  /** Writes what is chosen into `choices`. */
  constructor(private readonly choices: Choices, private readonly actions: ControlActions) {
    const c = choices;
    const cap = this.select('cap', capsWith(c.capBytesPerSecond).map(([text, v]) => [String(v), text]),
      String(c.capBytesPerSecond), (v) => { c.capBytesPerSecond = Number(v); });
    const policy = this.select('policy', kPolicies, c.policy, (v) => { c.policy = v as Choices['policy']; });
    this.scaleSelect = this.select('scale', [kScaleByDisplay], '',
      (v) => { c.scale = v === '' ? null : Number(v); });
    this.rungSelect = this.select('rung', [kRungByPlan], '',
      (v) => { c.rung = v === '' ? null : Number(v); });
    this.box = make('section', {}, make('h2', {}, 'How it loads'), make('div', { class: 'controls' },
      make('label', { for: 'time' }, 'Time'), this.timeSlider(),
      make('label', { for: 'cap' }, 'Connection'), cap,
      make('p', { class: 'note' }, 'Both count from the next load on.'),
      make('div', { class: 'buttons' },
        make('button', { type: 'button', class: 'primary', id: 'reload', onclick: () => actions.reload() },
          'Load again'),
        make('button', { type: 'button', id: 'refine', onclick: () => actions.refine() }, 'Sharpen')),
    ));
    this.experts = foldingSection('For experts', 'The policy counts from the next load on.',
      c.policy !== 'guard' || c.scale !== null || c.rung !== null, make('div', { class: 'controls' },
        make('label', { for: 'policy' }, 'Policy'), policy,
        make('label', { for: 'scale' }, 'Mesh scale'), this.scaleSelect,
        make('label', { for: 'rung' }, 'Texture'), this.rungSelect));
    this.experts.id = 'experts';
  }

  /** Offers the scales of a package. */
  offerScales(m: Manifest): void {
    const scales =
      m.scales.map((s): Option => [String(s.scale), `S_${s.scale} · ${format.count(s.triangles)} triangles`]);
    this.scaleSelect.replaceChildren(...options([kScaleByDisplay, ...scales]));
    this.scaleSelect.value = this.choices.scale === null ? '' : String(this.choices.scale);
    if (this.scaleSelect.selectedIndex < 0) this.scaleSelect.value = String(m.scales.at(-1)?.scale ?? '');
  }

  /** Offers the rungs of the longest ladder: planes with fewer rungs take their highest. */
  offerRungs(textures: readonly TextureInfo[]): void {
    const qualities = textures.map((t) => t.rungQuality).reduce((a, b) => (b.length > a.length ? b : a), []);
    const rungs = qualities.map((q, r): Option => [String(r), `rung ${r} · quality ${q}`]);
    this.rungSelect.replaceChildren(...options([kRungByPlan, ...rungs]));
    this.rungSelect.value = this.choices.rung === null ? ''
      : String(Math.min(this.choices.rung, qualities.length - 1));
  }

  private changed(): void {
    this.actions.choose({ ...this.choices });
  }

  private timeSlider(): HTMLElement {
    const c = this.choices;
    const said = make('output', { for: 'time' }, format.seconds(c.timeS));
    const last = kTimes.length - 1;
    const nearest = kTimes.findIndex((t) => t >= c.timeS);
    const slider = make('input', {
      type: 'range', id: 'time', min: '0', max: String(last), step: '1',
      value: String(nearest < 0 ? last : nearest), 'aria-valuetext': format.seconds(c.timeS),
      oninput: () => {
        c.timeS = kTimes[Number(slider.value)] ?? Infinity;
        said.textContent = format.seconds(c.timeS);
        slider.setAttribute('aria-valuetext', format.seconds(c.timeS));
      },
      onchange: () => this.changed(),
    });
    return make('div', { class: 'row' }, slider, said);
  }

  private select(id: string, offered: Option[], value: string,
      set: (value: string) => void): HTMLSelectElement {
    const e = make('select', { id, onchange: () => { set(e.value); this.changed(); } }, ...options(offered));
    e.value = value;
    return e;
  }
}

type Option = [value: string, text: string];
const kScaleByDisplay: Option = ['', 'by displayed size'];
const kRungByPlan: Option = ['', 'by time and importance'];

function options(offered: Option[]): HTMLOptionElement[] {
  return offered.map(([value, text]) => make('option', { value }, text));
}
