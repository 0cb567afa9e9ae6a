// Prints the issues of every glTF file named, as one JSON object by file name.
const { readFileSync } = require("node:fs");
const { basename } = require("node:path");
const { validateBytes } = require("./index.js");

async function main(files) {
  const found = {};
  for (const file of files) {
    const { issues } = await validateBytes(new Uint8Array(readFileSync(file)), { maxIssues: 0 });
    found[basename(file)] = issues;
  }
  process.stdout.write(JSON.stringify(found));
}

main(process.argv.slice(2));
