import { defineConfig } from "vite";

/** `npm run dev` shows the page as it is edited, beside a server that runs already. */
const server = process.env.PALPATE ?? "http://127.0.0.1:7257";
const behind = { target: server, changeOrigin: true };

export default defineConfig({
  build: { target: "es2022", assetsInlineLimit: 0, chunkSizeWarningLimit: 1500 },
  server: { proxy: { "/v1": behind, "/version": behind, "/readyz": behind, "/docs": behind } },
});
