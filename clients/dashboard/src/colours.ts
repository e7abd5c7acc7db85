/** How numbers become colours. */

export type Palette = "paper" | "cividis";

type Rgb = [number, number, number];

/** Green where the surface is certain, red where it is a guess, as in the paper; and cividis, for all eyes. */
const STOPS: Record<Palette, Rgb[]> = {
  paper: [[0, 0.5, 0.16], [0.55, 0.72, 0.16], [0.95, 0.8, 0.2], [0.9, 0.45, 0.12], [0.75, 0.1, 0.1]],
  cividis: [[0, 0.135, 0.305], [0.255, 0.302, 0.424], [0.486, 0.482, 0.471], [0.737, 0.686, 0.435], [0.995, 0.909, 0.217]],
};

/** The colour of a share of the range, each part in [0, 1], sRGB. */
export function colour(palette: Palette, value: number): Rgb {
  const stops = STOPS[palette];
  const place = Math.min(Math.max(value, 0), 1) * (stops.length - 1);
  const index = Math.min(Math.floor(place), stops.length - 2);
  const [low, high] = [stops[index]!, stops[index + 1]!];
  return low.map((part, axis) => part + (place - index) * (high[axis]! - part)) as Rgb;
}

/** A strip of the palette for the legend. */
export function strip(palette: Palette): HTMLCanvasElement {
  const canvas = document.createElement("canvas");
  [canvas.width, canvas.height] = [128, 1];
  const context = canvas.getContext("2d")!;
  for (let x = 0; x < 128; x++) {
    context.fillStyle = `rgb(${colour(palette, x / 127).map((part) => Math.round(255 * part)).join(" ")})`;
    context.fillRect(x, 0, 1, 1);
  }
  return canvas;
}
