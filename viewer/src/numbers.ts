// Numbers as text.

// Without the sign of a zero.
export function plain(value: number, digits: number): string {
  return (Number(value.toFixed(digits)) || 0).toFixed(digits).replace("-", "−");
}

export function signed(value: number, digits: number): string {
  return `${value < 0 ? "−" : "+"}${Math.abs(value).toFixed(digits)}`;
}
