// Builds the pages that trajopt/report/viewer/ fills: each a template with its style and bundled script inside.
import { build } from "esbuild";
import { copyFileSync, mkdirSync, readFileSync, writeFileSync } from "node:fs";

const OUT = new URL("../trajopt/report/viewer/pages/", import.meta.url);
mkdirSync(OUT, { recursive: true });
for (const page of ["motion", "sweep", "bench"]) {
  const bundle = await build({
    entryPoints: [`src/${page}.js`], bundle: true, minify: true, write: false, format: "iife", target: "es2022",
    legalComments: "none",
  });
  const script = bundle.outputFiles[0].text.replaceAll("</script", "<\\/script");
  const style = readFileSync("src/style.css", "utf8");
  const parts = { title: page, style, script, body: readFileSync(`src/${page}.html`, "utf8") };
  const whole = readFileSync("src/page.html", "utf8").replace(/\{\{(\w+)\}\}/g, (all, key) => parts[key] ?? all);
  writeFileSync(new URL(`${page}.html`, OUT), whole);
  console.log(`${page}.html ${(whole.length / 1e3).toFixed(0)} kB`);
}
copyFileSync("node_modules/three/LICENSE", new URL("LICENSE-three.txt", OUT));
