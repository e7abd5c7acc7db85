import { defineConfig } from "vite";

// While the page is developed, calls go to a server that runs beside it, as if they came from its own page.
const target = process.env.PALPATE_URL ?? "http://127.0.0.1:7257";
const proxied = { target, changeOrigin: true, headers: { origin: target } };

export default defineConfig({
  build: { chunkSizeWarningLimit: 1000, assetsInlineLimit: 0, modulePreload: { polyfill: false } },
  server: { proxy: { "/v1": proxied, "/version": proxied, "/docs": proxied, "/openapi.json": proxied } },
});
