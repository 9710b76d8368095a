// Vectors of three numbers.

export const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
export const minus = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
export const along = (start, direction, length) => start.map((value, axis) => value + length * direction[axis]);
export const clamp = (value, low, high) => Math.min(Math.max(value, low), high);
