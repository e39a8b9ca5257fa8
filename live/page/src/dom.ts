// The page is written piece by piece and only where something changed. Text of the state only ever becomes text.

export function byId<T extends HTMLElement = HTMLElement>(id: string): T {
  const found = document.getElementById(id);
  if (!found) throw new Error(`the page has no element ${id}`);
  return found as T;
}

export function element<K extends keyof HTMLElementTagNameMap>(tag: K, className = '', text = ''): HTMLElementTagNameMap[K] {
  const made = document.createElement(tag);
  if (className) made.className = className;
  if (text) made.textContent = text;
  return made;
}

export function drawing<K extends keyof SVGElementTagNameMap>(
  tag: K,
  attributes: Record<string, string | number> = {},
): SVGElementTagNameMap[K] {
  const made = document.createElementNS('http://www.w3.org/2000/svg', tag);
  for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, String(value));
  return made;
}

export function say(target: Element, text: string): void {
  if (target.textContent !== text) target.textContent = text;
}

export function mark(target: Element, name: string, value: string | null): void {
  if (value === null) {
    if (target.hasAttribute(name)) target.removeAttribute(name);
  } else if (target.getAttribute(name) !== value) {
    target.setAttribute(name, value);
  }
}

export function show(target: HTMLElement, visible: boolean): void {
  if (target.hidden === visible) target.hidden = !visible;
}

/** Keeps one element per key, in the order of the items; elements that stay are not touched, so that focus and selection stay. */
export class Keyed<Item, Made extends { root: Element }> {
  private readonly made = new Map<string, Made>();

  constructor(
    private readonly parent: Element,
    private readonly make: (item: Item, key: string) => Made,
    private readonly fill: (made: Made, item: Item) => void,
  ) {}

  update(items: readonly Item[], keyOf: (item: Item, index: number) => string): void {
    const wanted = new Set<string>();
    let before: Element | null = null;
    items.forEach((item, index) => {
      let key = keyOf(item, index);
      while (wanted.has(key)) key += '+';
      wanted.add(key);
      let entry = this.made.get(key);
      if (!entry) {
        entry = this.make(item, key);
        this.made.set(key, entry);
      }
      this.fill(entry, item);
      const place: Element | null = before ? before.nextElementSibling : this.parent.firstElementChild;
      if (entry.root !== place) this.parent.insertBefore(entry.root, place);
      before = entry.root;
    });
    for (const [key, entry] of this.made) {
      if (wanted.has(key)) continue;
      entry.root.remove();
      this.made.delete(key);
    }
  }
}
