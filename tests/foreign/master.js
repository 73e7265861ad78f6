/* An independent CANopen master (npm `canopen`) takes the simulated drive at node 1 through a day's work.
 *
 * Frames travel over stdin and stdout, one a line: identifier and data in hexadecimal ("601 4000100000000000").
 * Whatever is not as the standards say ends the process with exit code 1 and the reason on stderr.
 */
const assert = require('node:assert');
const readline = require('node:readline');
const { Device, DataType, Eds, NmtState } = require('canopen');

const DRIVE = 1;
const TIMEOUT = 5000; // ms of wall-clock time for one answer; lock-step time may run slower
const { UNSIGNED8, INTEGER8, UNSIGNED16, INTEGER16, UNSIGNED32, INTEGER32, VISIBLE_STRING } = DataType;

const eds = new Eds();
eds.addSdoClientParameter(DRIVE, 0x600 + DRIVE, 0x580 + DRIVE);
eds.addHeartbeatConsumer(DRIVE, TIMEOUT);
eds.setSyncCobId(0x80);
eds.setSyncGenerationEnable(true);
const status = eds.addEntry(0x2000, { parameterName: 'statusword', dataType: UNSIGNED16 });
const position = eds.addEntry(0x2001, { parameterName: 'position', dataType: INTEGER32 });
eds.addReceivePdo({ cobId: 0x280 + DRIVE, dataObjects: [status, position] });

const device = new Device({ id: 0x7d, eds });
device.on('message', ({ id, data }) => {
    process.stdout.write(`${id.toString(16)} ${Buffer.from(data ?? []).toString('hex')}\n`);
});
readline.createInterface({ input: process.stdin }).on('line', (line) => {
    const [id, hex] = line.split(' ');
    const data = Buffer.from(hex, 'hex');
    device.receive({ id: parseInt(id, 16), data, len: data.length });
});

const read = (index, subIndex, dataType) =>
    device.sdo.upload({ deviceId: DRIVE, index, subIndex, dataType, timeout: TIMEOUT });
const write = (index, subIndex, dataType, data) =>
    device.sdo.download({ deviceId: DRIVE, index, subIndex, dataType, data, timeout: TIMEOUT });

function heard(emitter, event, matches, what) {
    return new Promise((resolve, reject) => {
        const timer = setTimeout(() => reject(new Error(`no ${what}`)), TIMEOUT);
        emitter.on(event, (told) => {
            if (matches(told)) {
                clearTimeout(timer);
                resolve(told);
            }
        });
    });
}

const inState = (wanted) => heard(device.nmt, 'heartbeat', ({ state }) => state === wanted, `heartbeat ${wanted}`);

async function until(index, dataType, mask, wanted) {
    const deadline = Date.now() + TIMEOUT;
    for (;;) {
        const value = await read(index, 0, dataType);
        if ((value & mask) === wanted)
            return;
        assert(Date.now() < deadline, `0x${index.toString(16)} stays 0x${value.toString(16)}`);
    }
}

async function main() {
    device.start();
    device.nmt.startNode(); // this master itself

    // Who is there? Expedited, in records, and segmented.
    assert.strictEqual(await read(0x1000, 0, UNSIGNED32), 0x00020192);
    assert.strictEqual(await read(0x1018, 0, UNSIGNED8), 4);
    assert.strictEqual(await read(0x1018, 2, UNSIGNED32), 0x402);
    assert.strictEqual(await read(0x1008, 0, VISIBLE_STRING), 'simulated CiA 402 drive');
    await assert.rejects(read(0x5FFF, 0, UNSIGNED32), { code: 0x06020000 });
    await assert.rejects(write(0x1000, 0, UNSIGNED32, 1), { code: 0x06010002 });

    // Statusword and position at every SYNC; heartbeats.
    await write(0x1801, 1, UNSIGNED32, 0x80000280 + DRIVE);
    await write(0x1801, 2, UNSIGNED8, 1);
    await write(0x1A01, 0, UNSIGNED8, 0);
    await write(0x1A01, 1, UNSIGNED32, 0x60410010);
    await write(0x1A01, 2, UNSIGNED32, 0x60640020);
    await write(0x1A01, 0, UNSIGNED8, 2);
    await write(0x1801, 1, UNSIGNED32, 0x280 + DRIVE);
    const operational = inState(NmtState.OPERATIONAL);
    await write(0x1017, 0, UNSIGNED16, 20);
    device.nmt.startNode(DRIVE);
    await operational;
    const feedback = heard(device.pdo, 'pdo', ({ cobId }) => cobId === 0x280 + DRIVE, 'TPDO after a SYNC');
    device.sync.write();
    await feedback;
    assert.strictEqual(status.value & 0x4f, 0x40);
    assert.strictEqual(position.value, await read(0x6064, 0, INTEGER32));

    // Cyclic synchronous torque: mode, state machine, a target, and back.
    await write(0x6060, 0, INTEGER8, 10);
    await until(0x6061, INTEGER8, 0xff, 10);
    for (const [control, state] of [[0x06, 0x21], [0x07, 0x23], [0x0f, 0x27]]) {
        await write(0x6040, 0, UNSIGNED16, control);
        await until(0x6041, UNSIGNED16, 0x6f, state);
    }
    await write(0x6071, 0, INTEGER16, 100);
    const moving = heard(device.pdo, 'pdo', () => (status.value & 0x6f) === 0x27, 'TPDO of an enabled drive');
    device.sync.write();
    await moving;
    await write(0x6071, 0, INTEGER16, 0);
    await write(0x6040, 0, UNSIGNED16, 0x00);
    await until(0x6041, UNSIGNED16, 0x4f, 0x40);

    const stopped = inState(NmtState.STOPPED);
    device.nmt.stopNode(DRIVE);
    await stopped;
    const waiting = inState(NmtState.PRE_OPERATIONAL);
    device.nmt.enterPreOperational(DRIVE);
    await waiting;
}

main().then(() => process.exit(0), (error) => {
    process.stderr.write(`${error.stack}\n`);
    process.exit(1);
});
