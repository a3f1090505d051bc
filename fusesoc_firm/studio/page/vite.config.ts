import { svelte } from "@sveltejs/vite-plugin-svelte";
import { defineConfig } from "vite";

// All addresses are relative, since a secret is part of the page's address.
export default defineConfig({
  base: "./",
  plugins: [svelte()],
  build: {
    outDir: "../static",
    emptyOutDir: true,
    license: { fileName: "licences.md" },
    chunkSizeWarningLimit: 4000,
    rollupOptions: {
      output: { entryFileNames: "assets/[name].js", chunkFileNames: "assets/[name].js", assetFileNames: "assets/[name][extname]" },
    },
  },
});
