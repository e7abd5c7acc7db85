// What is shown, in the address: the sessions, the revision where it is not live, and the camera.

export interface Place {
  sessions: string[];
  revision: number | null;
  camera: number[] | null;
}

export function read(hash: string): Place {
  const [path = "", query = ""] = hash.replace(/^#\/?/, "").split("?");
  const params = new URLSearchParams(query);
  const camera = (params.get("camera") ?? "").split(",").map(Number);
  const revision = Number(params.get("revision"));
  return {
    sessions: path.split("+").filter(Boolean).slice(0, 4).map(decodeURIComponent),
    revision: revision > 0 ? revision : null,
    camera: camera.length === 6 && camera.every(Number.isFinite) ? camera : null,
  };
}

export function write(place: Place): string {
  const query = [
    place.revision ? `revision=${place.revision}` : "",
    place.camera ? `camera=${place.camera.map((part) => part.toFixed(4)).join(",")}` : "",
  ].filter(Boolean);
  return `#/${place.sessions.map(encodeURIComponent).join("+")}${query.length ? `?${query.join("&")}` : ""}`;
}
