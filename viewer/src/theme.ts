import type { Words } from "./bundle.ts";
import type { Theme } from "./link.ts";

const night = matchMedia("(prefers-color-scheme: dark)");

export function paint(words: Words, theme: Theme): void {
  const name = theme === "system" ? (night.matches ? "dark" : "light") : theme;
  const { style, dataset } = document.documentElement;
  dataset["theme"] = name;
  style.colorScheme = name;
  for (const [key, colour] of Object.entries(words.themes[name])) style.setProperty(`--${key}`, colour);
}

export function onSystemChange(act: () => void): void {
  night.addEventListener("change", act);
}
