// Keys act unless something is typed into.

export type Acts = Record<string, () => void>;

export function listen(acts: Acts, isOff: () => boolean): void {
  document.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey || isOff()) return;
    const from = event.target as HTMLElement;
    const isTyping = from.matches("select, textarea, input[type=number]");
    const isPressing = from.matches("button, a, summary, input[type=checkbox]");
    const key = event.key.length === 1 ? event.key.toLowerCase() : event.key;
    if (isTyping || (isPressing && key === " ")) return;
    const isArrow = key.startsWith("Arrow");
    const act = acts[event.shiftKey && isArrow ? `shift+${key}` : key];
    if (!act) return;
    event.preventDefault();
    act();
  });
}
