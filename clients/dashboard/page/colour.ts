// The colours of a value in [0, 1]: red is uncertain as in the paper, or cividis for the colour-blind.

export type Scale = "paper" | "cividis";
type Rgb = [number, number, number];

const STOPS: Record<Scale, Rgb[]> = {
  paper: [[0.1, 0.6, 0.31], [0.99, 0.88, 0.45], [0.84, 0.15, 0.16]],
  cividis: [[0, 0.14, 0.3], [0.23, 0.29, 0.42], [0.49, 0.48, 0.47], [0.73, 0.68, 0.44], [0.99, 0.91, 0.28]],
};

export function colour(scale: Scale, value: number): Rgb {
  const stops = STOPS[scale];
  const place = Math.min(Math.max(value, 0), 1) * (stops.length - 1);
  const index = Math.min(Math.floor(place), stops.length - 2);
  return [0, 1, 2].map((i) => stops[index]![i]! + (place - index) * (stops[index + 1]![i]! - stops[index]![i]!)) as Rgb;
}

export function gradient(scale: Scale): string {
  const stops = STOPS[scale].map((rgb) => `rgb(${rgb.map((part) => Math.round(part * 255)).join(" ")})`);
  return `linear-gradient(to right, ${stops.join(", ")})`;
}
