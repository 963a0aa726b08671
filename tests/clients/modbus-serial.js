// modbus-serial: identification, position, the hand-shake, an exception.
const ModbusRTU = require(process.argv[3]);
const client = new ModbusRTU();
const i32 = (words) => (words[0] << 16) | words[1];
let beat = 0;
async function main() {
  await client.connectTCP("127.0.0.1", { port: Number(process.argv[2]) });
  client.setID(1);
  beat = (await client.readHoldingRegisters(40, 1)).data[0];
  const read = async (address, count) => (await client.readHoldingRegisters(address, count)).data;
  const heart = () => client.writeRegisters(40, [(beat = (beat + 1) % 65536)]);
  async function command(number, target) {
    const sequence = ((await read(23, 1))[0] + 1) % 65536;
    await heart();
    await client.writeRegisters(41, [number, (target >> 16) & 0xffff, target & 0xffff, 0, 0, sequence]);
    for (;;) {
      const [acknowledged, result, reason] = await read(23, 3);
      if (acknowledged === sequence && result !== 1) return [result, reason];
      await heart();
    }
  }
  const found = { identification: (await read(0, 1))[0] };
  found.enabled = await command(1, 0);
  found.moved = await command(7, 45000);
  found.position = i32(await read(16, 2));
  try {
    await client.writeRegisters(16, [1]);
  } catch (error) {
    found.exception = error.modbusCode;
  }
  console.log(JSON.stringify(found));
  client.close();
}
main();
