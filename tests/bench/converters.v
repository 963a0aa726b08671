// Both converters of the phase servo as a circuit (phase-servo specification 3.1, 3.2, 3.4, 3.5).
//
// One edge of `clock` is one period of the reference clocks, where CK2 ends: what CK1 has counted before is a sum on its
// way to a flip-flop, so that a simulator meets a single event per period. `from_oscillator` is the same circuit behind
// the toggle flip-flop 403, which makes the reference clocks from the oscillator.
//
// The stimulus is part of it: the secondary's phase, an accumulator that advances by `rate` per period [2^-32 turn].

module converters #(parameter BITS = 6) (
    input wire clock,
    input wire clear,                       // power-on: all counters together
    input wire [31:0] start,
    input wire [31:0] rate,
    output reg [BITS-1:0] drive_count,      // 451
    output reg delayed_msb,                 // 465
    output wire [3:0] switches,             // transistors: a, b of the first coil, a', b' of the second
    output reg [BITS-1:0] ref_count,        // 564
    output reg ps_first, ps_second,         // 551, 552
    output reg msb_first, msb_second,       // 553, 554
    output wire gate, plus, minus,          // 562, 550a, 550b
    output reg [BITS-1:0] free_count,       // 601
    output reg [BITS:0] gated_count,        // 603
    output reg [BITS:0] word,               // 604
    output wire latch,                      // the top bit of 601 rises
    output reg signed [31:0] net            // + pulses less - pulses
);
    localparam [BITS-1:0] ONE = 1;

    wire [BITS-1:0] next_drive = drive_count + ONE;
    wire b3 = drive_count[BITS-1], b2 = drive_count[BITS-2], b1 = drive_count[BITS-3];
    assign switches = {delayed_msb ^ b1, delayed_msb ^ ~b2, b3 ^ b1, b3 ^ b2};

    reg [31:0] phase;
    wire [BITS-1:0] angle = phase[31 -: BITS] + next_drive;
    wire ps = angle[BITS-1];

    wire [BITS-1:0] next_free = free_count + ONE;
    wire msb = next_free[BITS-1];
    assign latch = msb & ~free_count[BITS-1];

    assign gate = msb_first & ~msb_second;
    assign plus = gate & ps_first & ps_second;
    assign minus = gate & ~ps_first & ~ps_second;
    wire [BITS-1:0] next_ref = ref_count + ONE + {{(BITS - 1){1'b0}}, plus} - {{(BITS - 1){1'b0}}, minus};

    always @(posedge clock)
        if (clear) begin
            drive_count <= 0;
            delayed_msb <= 1;
            phase <= start;
            ps_first <= 0;
            ps_second <= 0;
            msb_first <= 0;
            msb_second <= 0;
            ref_count <= 0;
            free_count <= 0;
            gated_count <= 0;
            word <= 0;
            net <= 0;
        end else begin
            drive_count <= next_drive;
            if (next_drive[BITS-2] & ~b2)
                delayed_msb <= next_drive[BITS-1];
            phase <= phase + rate;
            ps_first <= ps;
            ps_second <= ps_first;
            msb_first <= next_ref[BITS-1];
            msb_second <= msb_first;
            ref_count <= next_ref;
            net <= net + {31'b0, plus} - {31'b0, minus};
            free_count <= next_free;
            if (latch) begin
                word <= gated_count;
                gated_count <= {{BITS{1'b0}}, msb ^ ps};
            end else
                gated_count <= gated_count + {{BITS{1'b0}}, msb ^ ps};
        end
endmodule

module from_oscillator #(parameter BITS = 6) (
    input wire clock,                       // oscillator
    input wire clear,
    input wire [31:0] start,
    input wire [31:0] rate,
    output wire [BITS-1:0] drive_count,
    output wire delayed_msb,
    output wire [3:0] switches,
    output wire [BITS-1:0] ref_count,
    output wire ps_first, ps_second, msb_first, msb_second, gate, plus, minus,
    output wire [BITS-1:0] free_count,
    output wire [BITS:0] gated_count, word,
    output wire latch,
    output wire signed [31:0] net
);
    reg toggle;                             // 403
    initial toggle = 0;
    always @(posedge clock) toggle <= ~toggle;

    converters #(.BITS(BITS)) both (
        .clock(toggle), .clear(clear), .start(start), .rate(rate),
        .drive_count(drive_count), .delayed_msb(delayed_msb), .switches(switches),
        .ref_count(ref_count), .ps_first(ps_first), .ps_second(ps_second),
        .msb_first(msb_first), .msb_second(msb_second), .gate(gate), .plus(plus), .minus(minus),
        .free_count(free_count), .gated_count(gated_count), .word(word), .latch(latch), .net(net));
endmodule
