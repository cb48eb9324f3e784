import { rules, schemas } from 'texmesh-rules';
import { FormatError } from '../format/errors';
import { Expression, Parser, Scope } from './expressions';
import { Cursor, requireRule } from './fields';
import { builtIns } from './functions';
import { Dict, Value, isTrue } from './values';
import { Schema, validate } from './schema';

/** A line of format/rules.txt, whose head says how to read it. */
interface Line {
  name: string;
  /** Empty: a rule; "=": a name; otherwise the type of a field. */
  kind: string;
  text: string;
  expression?: Expression;
}

function readSections(text: string): Map<string, Line[]> {
  const sections = new Map<string, Line[]>();
  let lines: Line[] = [];
  for (const line of text.split('\n').map((l) => l.trimEnd()).filter((l) => l && !l.startsWith('#')))
    if (line.startsWith('[')) sections.set(line.slice(1, line.indexOf(']')), (lines = []));
    else {
      const [, name, rest] = /^(\S+)\s+(.*)$/.exec(line)!;
      const [, kind, value] = /^[A-Z]\d\d$/.test(name) ? ['', '', rest] : /^(\S+)\s*(.*)$/.exec(rest)!;
      lines.push({ name, kind, text: value, expression: value ? new Parser(value).whole() : undefined });
    }
  return sections;
}

const sections = readSections(rules);
let constants: Scope | undefined;

function run(lines: readonly Line[], scope: Scope, where: string, cursor?: Cursor): Dict {
  for (const { name, kind, text, expression } of lines) {
    let value: Value;
    try {
      value = expression?.(scope) ?? null;
      if (kind && kind !== '=') value = cursor!.field(kind, value);
      else if (!kind) value = isTrue(value);
    } catch (error) {
      if (error instanceof FormatError) throw error;
      throw new FormatError('', where, text, `${error}`, 'J04'); // a field is missing, or of another type
    }
    if (!kind) requireRule(value, name, where, text);
    else scope.names.set(name, value);
  }
  return scope.names;
}

/** What the section "constants" names, and functions. */
export function constant(name: string): Value {
  return known().find(name);
}
function known(): Scope {
  if (!constants) {
    constants = new Scope(new Map(builtIns));
    run(sections.get('constants')!, constants, 'constants');
  }
  return constants;
}

/** Fields and names of a section, beside `names`; FormatError by the first rule that is broken. */
export function follow(section: string, names: Record<string, Value>, cursor?: Cursor): Dict {
  return run(sections.get(section)!, new Scope(new Map(Object.entries(names)), known()), cursor?.what ?? section, cursor);
}

/** A document, which follows the schema of that name. */
export function followSchema(document: Value, name: string, what: string): void {
  validate(document, schemas[name] as Schema, what);
}
