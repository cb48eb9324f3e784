import { Call, Dict, Mismatch, SetOf, Value, dictOf, each, isTrue, item, listOf, numberOf, operate, shown, slice, textOf } from './values';
import { method } from './functions';
import { Tokens } from './tokens';

/** Names that an expression may use, those of the places around it behind. */
export class Scope {
  constructor(
    readonly names: Map<string, Value>,
    private readonly around_?: Scope,
  ) {}
  find(name: string): Value {
    const found = this.names.get(name);
    if (found !== undefined) return found;
    if (!this.around_) throw new Mismatch(`no ${name}`);
    return this.around_.find(name);
  }
}
export type Expression = (scope: Scope) => Value;
type Target = string | Target[];

/** Operators of two operands, those that bind loosest first. Comparisons stand between `not` and these. */
const levels = [['|'], ['&'], ['<<', '>>'], ['+', '-'], ['*', '/', '//', '%']];
const comparisons = ['==', '!=', '<=', '>=', '<', '>'];

/**
 * Reads the part of Python that format/rules.txt is written in: no statement, no import, nothing that reaches beyond the names that it is
 * given. Expressions become functions; nothing is made into JavaScript text, so pages whose policy forbids eval may use them.
 */
export class Parser {
  private readonly t_: Tokens;

  constructor(text: string) {
    this.t_ = new Tokens(text);
  }
  /** The whole text; names with commas between are a list. */
  whole(): Expression {
    const first = this.any_();
    const list = this.t_.is(',') ? this.listFrom_(first, '') : first;
    if (this.t_.next.kind !== 'end') this.t_.fail();
    return list;
  }
  private any_(): Expression {
    if (this.t_.take('lambda')) {
      const name = this.t_.name();
      this.t_.expect(':');
      const body = this.any_();
      return (scope) => (([value]: Value[]) => body(new Scope(new Map([[name, value]]), scope))) as Call;
    }
    const value = this.or_();
    if (!this.t_.take('if')) return value;
    const condition = this.or_();
    this.t_.expect('else');
    const other = this.any_();
    return (scope) => (isTrue(condition(scope)) ? value(scope) : other(scope));
  }
  private or_(): Expression {
    const first = this.and_();
    if (!this.t_.take('or')) return first;
    const rest = this.or_();
    return (scope) => {
      const value = first(scope);
      return isTrue(value) ? value : rest(scope);
    };
  }
  private and_(): Expression {
    const first = this.not_();
    if (!this.t_.take('and')) return first;
    const rest = this.and_();
    return (scope) => {
      const value = first(scope);
      return isTrue(value) ? rest(scope) : value;
    };
  }
  private not_(): Expression {
    if (!this.t_.take('not')) return this.comparison_();
    const value = this.not_();
    return (scope) => !isTrue(value(scope));
  }
  private comparisonSign_(): string {
    const sign = this.t_.take(...comparisons, 'in', 'is', 'not');
    if (sign === 'not') this.t_.expect('in');
    return sign === 'not' ? 'not in' : sign === 'is' && this.t_.take('not') ? 'is not' : sign;
  }
  private comparison_(): Expression {
    const first = this.binary_(0);
    const rest: [string, Expression][] = [];
    for (let sign = this.comparisonSign_(); sign; sign = this.comparisonSign_()) rest.push([sign, this.binary_(0)]);
    if (rest.length === 0) return first;
    return (scope) => {
      let [left, result]: Value[] = [first(scope), true];
      for (const [sign, operand] of rest) {
        const right = operand(scope);
        result = operate(sign, left, right);
        if (rest.length > 1 && !isTrue(result)) return false;
        left = right;
      }
      return result;
    };
  }
  private binary_(level: number): Expression {
    if (level === levels.length) return this.unary_();
    let left = this.binary_(level + 1);
    for (let sign = this.t_.take(...levels[level]); sign; sign = this.t_.take(...levels[level])) {
      const [a, b, operator] = [left, this.binary_(level + 1), sign];
      left = (scope) => operate(operator, a(scope), b(scope));
    }
    return left;
  }
  private unary_(): Expression {
    if (!this.t_.take('-')) return this.power_();
    const value = this.unary_();
    return (scope) => operate('*', value(scope), -1);
  }
  private power_(): Expression {
    const base = this.postfix_();
    if (!this.t_.take('**')) return base;
    const exponent = this.unary_();
    return (scope) => operate('**', base(scope), exponent(scope));
  }
  private postfix_(): Expression {
    let value = this.atom_();
    for (let sign = this.t_.take('.', '(', '['); sign; sign = this.t_.take('.', '(', '[')) {
      const of = value;
      if (sign === '[') value = this.index_(of);
      else if (sign === '(') {
        const call = this.arguments_();
        value = (scope) => call(scope, of(scope));
      } else {
        const name = this.t_.name();
        value = (scope) => {
          const owner = of(scope);
          return method(owner, name) ?? item(dictOf(owner), name);
        };
      }
    }
    return value;
  }
  private index_(of: Expression): Expression {
    const parts: Expression[] = [];
    let colons = 0;
    const nothing: Expression = () => null;
    while (!this.t_.is(']')) {
      if (this.t_.take(':')) ++colons;
      else parts[colons] = this.any_();
    }
    this.t_.expect(']');
    const [begin = nothing, end = nothing, step = nothing] = parts;
    if (colons === 0) return (scope) => item(of(scope), begin(scope));
    return (scope) => slice(of(scope), begin(scope), end(scope), step(scope));
  }
  private arguments_(): (scope: Scope, called: Value) => Value {
    const args: Expression[] = [];
    const named: [string, Expression][] = [];
    while (!this.t_.take(')')) {
      const name = this.t_.takeName('=');
      if (name) named.push([name, this.any_()]);
      else {
        const value = this.any_();
        args.push(this.t_.is('for') ? this.comprehension_((scope) => value(scope)) : value);
      }
      if (!this.t_.is(')')) this.t_.expect(',');
    }
    return (scope, called) => {
      if (typeof called !== 'function') throw new Mismatch(`call of ${shown(called)}`);
      return (called as Call)(args.map((a) => a(scope)), new Map(named.map(([name, value]) => [name, value(scope)])));
    };
  }

  private atom_(): Expression {
    const { kind, text, prefix } = this.t_.next;
    if (kind === 'number' || kind === 'text') {
      this.t_.skip();
      if (prefix === 'f') return formatted(text);
      const value = kind === 'number' ? Number(text) : prefix === 'b' ? bytesIn(text) : text;
      return () => value;
    }
    if (this.t_.take('(')) {
      if (this.t_.take(')')) return () => [];
      const first = this.item_();
      if (this.t_.is(',')) return this.listFrom_(first, ')');
      const value = this.t_.is('for') ? this.comprehension_(first) : first;
      this.t_.expect(')');
      return value;
    }
    if (this.t_.take('[')) {
      if (this.t_.take(']')) return () => [];
      const first = this.item_();
      if (!this.t_.is('for')) return this.listFrom_(first, ']');
      const members = this.comprehension_(first);
      this.t_.expect(']');
      return (scope) => listOf(members(scope));
    }
    if (this.t_.take('{')) return this.braces_();
    const name = this.t_.name();
    if (name === 'None') return () => null;
    return name === 'True' || name === 'False' ? () => name === 'True' : (scope) => scope.find(name);
  }
  /** An element, or all elements of a list behind a star. */
  private item_(): Expression & { isStarred?: boolean } {
    if (!this.t_.take('*')) return this.any_();
    return Object.assign(this.binary_(0), { isStarred: true });
  }
  private listFrom_(first: Expression & { isStarred?: boolean }, end: string): Expression {
    const members = [first];
    while (this.t_.take(',')) if (!this.t_.is(')', ']')) members.push(this.item_());
    if (end) this.t_.expect(end);
    return (scope) => members.flatMap((m) => (m.isStarred ? listOf(m(scope)) : [m(scope)]));
  }
  private braces_(): Expression {
    if (this.t_.take('}')) return () => new Map();
    let isDict = false;
    const pair = (): Expression => {
      const key = this.any_();
      if (!this.t_.take(':')) return key;
      isDict = true;
      const value = this.any_();
      return (scope) => [key(scope), value(scope)];
    };
    const first = pair();
    const make = (members: Value): Value =>
      isDict ? (new Map(listOf(members) as [string, Value][]) satisfies Dict) : new SetOf(each(members));
    let members: Expression;
    if (this.t_.is('for')) members = this.comprehension_(first);
    else {
      const all = [first];
      while (this.t_.take(',')) all.push(pair());
      members = (scope) => all.map((one) => one(scope));
    }
    this.t_.expect('}');
    return (scope) => make(members(scope));
  }
  private comprehension_(value: Expression): Expression {
    const steps: { target?: Target; of: Expression }[] = [];
    while (this.t_.is('for', 'if'))
      if (this.t_.take('if')) steps.push({ of: this.or_() });
      else {
        this.t_.expect('for');
        const target = this.target_();
        this.t_.expect('in');
        steps.push({ target, of: this.or_() });
      }
    function* run(scope: Scope, k: number): Generator<Value> {
      if (k === steps.length) yield value(scope);
      else {
        const { target, of } = steps[k];
        if (!target) {
          if (isTrue(of(scope))) yield* run(scope, k + 1);
        } else
          for (const member of each(of(scope))) {
            const inner = new Scope(new Map(), scope);
            assign(target, member, inner.names);
            yield* run(inner, k + 1);
          }
      }
    }
    return (scope) => run(scope, 0);
  }
  private target_(): Target {
    const one = (): Target => {
      if (!this.t_.take('(')) return this.t_.name();
      const inner = this.target_();
      this.t_.expect(')');
      return inner;
    };
    const targets = [one()];
    while (this.t_.take(',')) targets.push(one());
    return targets.length === 1 ? targets[0] : targets;
  }
}

function assign(target: Target, value: Value, names: Map<string, Value>): void {
  if (typeof target === 'string') return void names.set(target, value);
  const values = listOf(value);
  if (values.length !== target.length) throw new Mismatch(`${target.length} values`);
  target.forEach((t, k) => assign(t, values[k], names));
}
function bytesIn(text: string): Uint8Array {
  const plain = text.replace(/\\x([\da-f]{2})/g, (_, digits: string) => String.fromCharCode(parseInt(digits, 16)));
  return Uint8Array.from(plain, (c) => c.charCodeAt(0));
}
/** A text with values in braces: as they are, with zeros in front (:03), or with so many digits (:.6g). */
function formatted(text: string): Expression {
  const parts = text.split(/\{([^{}]*)\}/).map((part, k): Expression => {
    if (k % 2 === 0) return () => part;
    const [, source, spec] = /^(.*?)(?::(0\d|\.\dg))?$/.exec(part)!;
    const value = new Parser(source).whole();
    if (!spec) return (scope) => String(value(scope));
    if (spec.startsWith('0')) return (scope) => String(numberOf(value(scope))).padStart(Number(spec), '0');
    return (scope) => numberOf(value(scope)).toPrecision(Number(spec[1]));
  });
  return (scope) => parts.map((part) => textOf(part(scope))).join('');
}
