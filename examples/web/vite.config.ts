import { execFileSync } from "node:child_process";
import { createHash } from "node:crypto";
import { defineConfig, type Plugin } from "vite";

/** The wasm goes into the page as text that is no script: gzip, base64. `page/wasm.ts` opens it. */
function wasmInThePage(): Plugin {
  return {
    name: "wasm-in-the-page",
    transformIndexHtml() {
      // Packs it smaller than node does.
      const wasm = execFileSync("gzip", ["-9nc", "pkg/axlewire_web_bg.wasm"]);
      const attrs = { type: "text/plain", id: "wasm" };
      return [{ tag: "script", attrs, children: wasm.toString("base64"), injectTo: "body" }];
    },
  };
}

/** The glue of wasm-bindgen would look for a file beside the script; here there is none. */
function noWasmFile(): Plugin {
  return {
    name: "no-wasm-file",
    enforce: "pre",
    transform: (code, id) =>
      id.includes("axlewire_web.js")
        ? code.replace(/new URL\('axlewire_web_bg\.wasm', import\.meta\.url\)/, "undefined")
        : undefined,
  };
}

/**
 * Script and style go into index.html, and a policy that allows these, by their hashes, and no
 * network.
 */
function oneFile(): Plugin {
  const hash = (text: string) => `'sha256-${createHash("sha256").update(text).digest("base64")}'`;
  return {
    name: "one-file",
    apply: "build",
    enforce: "post",
    generateBundle(_options, bundle) {
      const html = bundle["index.html"];
      if (html?.type !== "asset") throw new Error("there is no index.html");
      let [script, style] = ["", ""];
      for (const [name, file] of Object.entries(bundle)) {
        if (file === html) continue;
        if (file.type === "chunk")
          script += file.code.replaceAll("</script", "<\\/script").replaceAll("<!--", "<\\!--");
        else if (name.endsWith(".css")) style += String(file.source);
        else throw new Error(`${name} would be a second file`);
        delete bundle[name];
      }
      const policy = [
        "default-src 'none'",
        `script-src ${hash(script)} 'wasm-unsafe-eval'`,
        `style-src ${hash(style)}`,
        "worker-src blob:",
        "img-src data:",
        "connect-src 'none'",
        "base-uri 'none'",
        "form-action 'none'",
      ].join("; ");
      html.source = String(html.source)
        .replace(/<script type="module"[^>]* src=[^>]*><\/script>\s*/, "")
        .replace(/<link rel="stylesheet"[^>]*>\s*/, "")
        .replace(
          "<!-- policy -->",
          () => `<meta http-equiv="Content-Security-Policy" content="${policy}">`,
        )
        .replace("</head>", () => `<style>${style}</style>\n</head>`)
        .replace("</body>", () => `<script type="module">${script}</script>\n</body>`);
    },
  };
}

export default defineConfig({
  base: "./",
  plugins: [noWasmFile(), wasmInThePage(), oneFile()],
  worker: { format: "iife", plugins: () => [noWasmFile()] },
  build: {
    target: "es2022",
    outDir: process.env.OUT ?? "dist",
    emptyOutDir: false,
    modulePreload: false,
    cssCodeSplit: false,
    reportCompressedSize: false,
  },
});
