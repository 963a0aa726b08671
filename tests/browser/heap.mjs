// An hour of what an axis tells, at the full rate of the scope, as fast as the page takes it. Usage: heap.mjs LINK

import { browser, enter, view } from "./panel.mjs";

const [HOUR, RATE, ROWS, CHANNELS] = [3600, 25, 40, 8];
const chromium = await browser();
const context = await chromium.newContext({ viewport: { width: 1000, height: 900 } });
const page = await enter(context, process.argv[2]);
const tools = await context.newCDPSession(page);
await view(page, "scope");
for (const name of ["effort", "state", "fault", "periods"]) await page.check(`input[name=channel][value=${name}]`);
await page.waitForTimeout(1000);

/** Hand the page messages of so many seconds; the real axis is no longer heard. */
const feed = (seconds) => page.evaluate(async ([messages, rows, channels]) => {
  const { link } = window.panel;
  link.socket.onmessage = null;
  const now = JSON.stringify(link.now);
  let first = link.rows.first + link.rows.count;
  for (let k = 0; k < messages; k += 1) {
    const frame = new ArrayBuffer(16 + 4 * rows * channels);
    const head = new DataView(frame);
    head.setBigInt64(0, BigInt(first), true);
    head.setInt32(8, rows, true);
    head.setInt32(12, channels, true);
    new Float32Array(frame, 16).fill(Math.sin(k / 50));
    first += rows;
    link.receive(frame);
    link.receive(now.replace(/"position": ?[^,]*/, `"position":${Math.sin(k / 50)}`));
    link.rows.first = first - rows;
    if (k % 100 === 99) await new Promise((done) => { setTimeout(done); });
  }
  return link.rows.first;
}, [seconds * RATE, ROWS, CHANNELS]);

async function heap() {
  await page.waitForTimeout(200);
  await tools.send("HeapProfiler.collectGarbage");
  return (await tools.send("Runtime.getHeapUsage")).usedSize;
}

await feed(HOUR / 20);
const before = await heap();
const begin = Date.now();
const last = await feed(HOUR);
console.log(JSON.stringify({ before, after: await heap(), rows: last, seconds: (Date.now() - begin) / 1e3, problems: page.problems }));
await chromium.close();
