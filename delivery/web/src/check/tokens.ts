const token = /\s*(?:(0x[\da-f]+|\d+(?:\.\d+)?(?:e[+-]?\d+)?)|([brf]?)('(?:[^'\\]|\\.)*'|"(?:[^"\\]|\\.)*")|([a-z_]\w*)|(\*\*|\/\/|<<|>>|[<>=!]=|[-+*/%&|<>()[\]{},:.=]))/iy;
export interface Token {
  kind: 'number' | 'text' | 'name' | 'sign' | 'end';
  text: string;
  prefix: string;
}
function tokensOf(text: string): Token[] {
  const tokens: Token[] = [];
  for (token.lastIndex = 0; token.lastIndex < text.length; ) {
    const at = token.lastIndex;
    const [, number, prefix, quoted, name, sign] = token.exec(text) ?? [];
    if (token.lastIndex === 0) throw new Error(`not read: ${text.slice(at)}`);
    if (number) tokens.push({ kind: 'number', text: number, prefix: '' });
    else if (quoted) tokens.push({ kind: 'text', text: quoted.slice(1, -1), prefix });
    else tokens.push({ kind: name ? 'name' : 'sign', text: name ?? sign, prefix: '' });
  }
  return [...tokens, { kind: 'end', text: '', prefix: '' }];
}


/** The words of a text, taken one after the other. */
export class Tokens {
  private readonly tokens_: Token[];
  private at_ = 0;

  constructor(private readonly text_: string) {
    this.tokens_ = tokensOf(text_);
  }
  get next(): Token {
    return this.tokens_[this.at_];
  }
  fail(): never {
    throw new Error(`not understood at ${this.next.text}: ${this.text_}`);
  }
  is(...texts: string[]): boolean {
    const { kind, text } = this.next;
    return (kind === 'sign' || kind === 'name') && texts.includes(text);
  }
  skip(): string {
    return this.tokens_[this.at_++].text;
  }
  /** Takes the next word where it is one of these; an empty text otherwise. */
  take(...texts: string[]): string {
    return this.is(...texts) ? this.skip() : '';
  }
  expect(text: string): void {
    if (!this.take(text)) this.fail();
  }
  name(): string {
    return this.next.kind === 'name' ? this.skip() : this.fail();
  }
  /** Takes a name and the sign behind it where both are there. */
  takeName(sign: string): string {
    const after = this.tokens_[this.at_ + 1];
    if (this.next.kind !== 'name' || after.kind !== 'sign' || after.text !== sign) return '';
    this.at_ += 2;
    return this.tokens_[this.at_ - 2].text;
  }
}
