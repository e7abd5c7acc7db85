/** Where in the dashboard one is, as the part of the address after the hash. A link to it leads there again. */

export interface Place {
  /** `sessions`, `session`, `compare`, `experiments` or `experiment`. */
  page: string;
  ids: string[];
  revision?: number;
  camera?: number[];
}

export function readPlace(hash = location.hash): Place {
  const [path = "", query = ""] = hash.replace(/^#\/?/, "").split("?");
  const [page = "", ...rest] = path.split("/").map(decodeURIComponent);
  const parameters = new URLSearchParams(query);
  const revision = Number(parameters.get("revision"));
  const camera = parameters.get("camera")?.split(",").map(Number);
  return {
    page: page || "sessions",
    ids: rest.flatMap((part) => part.split(",")).filter(Boolean),
    revision: Number.isInteger(revision) && revision > 0 ? revision : undefined,
    camera: camera?.length === 6 && camera.every(Number.isFinite) ? camera : undefined,
  };
}

export function linkTo({ page, ids, revision, camera }: Place): string {
  const parameters = [
    revision === undefined ? "" : `revision=${revision}`,
    camera === undefined ? "" : `camera=${camera.join(",")}`,
  ].filter(Boolean);
  const path = [page, ...(ids.length ? [ids.map(encodeURIComponent).join(",")] : [])].join("/");
  return `#/${path}${parameters.length ? `?${parameters.join("&")}` : ""}`;
}

/** Names where one is, without going anywhere. A page that is about to be left, since the address names another one
 * already, changes nothing: that one would never be opened. */
export function note(place: Place): void {
  const { page, ids } = readPlace();
  if (page === place.page && ids.join() === place.ids.join()) history.replaceState(null, "", linkTo(place));
}
