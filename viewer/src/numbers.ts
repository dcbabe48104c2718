// Numbers as text.

// Without the sign of a zero.
export function plain(value: number, digits: number): string {
  return (Number(value.toFixed(digits)) || 0).toFixed(digits).replace("-", "−");
}

export function signed(value: number, digits: number): string {
  return `${value < 0 ? "−" : "+"}${Math.abs(value).toFixed(digits)}`;
}

// With two decimals, or one significant digit where these would be zero: the sign of a margin is the verdict. Shares have the unit 1.
export function formatMargin(value: number, unit: string): string {
  const size = Math.abs(value);
  const text = size && size < 0.005 ? String(Number(size.toPrecision(1))) : size.toFixed(2);
  return `${value < 0 ? "−" : "+"}${text}${unit === "1" ? "" : ` ${unit}`}`;
}
