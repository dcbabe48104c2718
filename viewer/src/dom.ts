// Elements from plain values. Text is always text: names in data sets are strangers' input.

type Child = Node | string | null | undefined | false;
type Handler = (event: Event) => void;
type Props = Record<string, string | number | boolean | Handler | undefined>;

export function h<K extends keyof HTMLElementTagNameMap>(
  tag: K,
  props: Props = {},
  ...children: Child[]
): HTMLElementTagNameMap[K] {
  return fill(document.createElement(tag), props, children);
}

export function svg(tag: string, props: Props = {}, ...children: Child[]): SVGElement {
  return fill(document.createElementNS("http://www.w3.org/2000/svg", tag), props, children);
}

function fill<E extends Element>(element: E, props: Props, children: Child[]): E {
  for (const [name, value] of Object.entries(props)) {
    if (typeof value === "function") element.addEventListener(name, value);
    else if (value === true) element.setAttribute(name, name.startsWith("aria-") ? "true" : "");
    else if (value !== false && value !== undefined) element.setAttribute(name, String(value));
  }
  element.append(...children.filter((one): one is Node | string => !!one));
  return element;
}

const awaited = new WeakMap<Element, number>();

// Says of elements, to screen readers too, that an answer is awaited.
export async function busy<T>(elements: Element[], answer: Promise<T>): Promise<T> {
  const more = (by: 1 | -1): void => {
    for (const one of elements) {
      const many = (awaited.get(one) ?? 0) + by;
      awaited.set(one, many);
      one.setAttribute("aria-busy", String(many > 0));
    }
  };
  more(1);
  try {
    return await answer;
  } finally {
    more(-1);
  }
}

const keys = new WeakMap<Element, string>();

// Children of items by key. Those that are there as wanted stay: nothing is taken from under the
// hand, and what has the focus keeps it.
export function refill<T>(parent: Element, items: T[], keyOf: (item: T) => string, make: (item: T) => Element): void {
  items.forEach((item, k) => {
    const [there, key] = [parent.children[k], keyOf(item)];
    if (there && keys.get(there) === key) return;
    const made = make(item);
    keys.set(made, key);
    if (there) there.replaceWith(made);
    else parent.append(made);
  });
  while (parent.children.length > items.length) parent.lastElementChild!.remove();
}

const typed = new WeakSet<Element>();

// A field for a number; `put` leaves alone what is being typed.
export function field(props: Props): HTMLInputElement {
  const made = h("input", { type: "number", ...props });
  made.addEventListener("input", () => typed.add(made));
  for (const end of ["change", "blur"]) made.addEventListener(end, () => typed.delete(made));
  return made;
}

// Puts a value into a control, unless it is there: to put it again would undo what is being chosen.
export function put(control: HTMLInputElement | HTMLSelectElement, value: string): void {
  if (control.value !== value && !typed.has(control)) control.value = value;
}

// Text that may be the same as before: nothing is laid out anew for it.
export function write(element: Element, text: string): void {
  if (element.textContent !== text) element.textContent = text;
}

export function table(caption: string, head: string[], rows: Child[][]): HTMLElement {
  return h(
    "div",
    { class: "wide", tabindex: 0, role: "region", "aria-label": caption },
    h(
      "table",
      {},
      h("caption", {}, caption),
      h("thead", {}, h("tr", {}, ...head.map((one) => h("th", { scope: "col" }, one)))),
      h("tbody", {}, ...rows.map((row) => h("tr", {}, ...row.map((one) => h("td", {}, one))))),
    ),
  );
}

export function button(label: string, text: string, click: () => void, key = ""): HTMLButtonElement {
  return h("button", { type: "button", "aria-label": label, title: key ? `${label} (${key})` : label, click }, text);
}

export function select(label: string, options: [string, string][], change: (value: string) => void): HTMLSelectElement {
  const list = h("select", { "aria-label": label, title: label }, ...options.map(([value, text]) => h("option", { value }, text)));
  list.addEventListener("change", () => change(list.value));
  return list;
}
