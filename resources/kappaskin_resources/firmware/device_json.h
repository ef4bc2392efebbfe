/* Made from device.json by embed.py: what this board says it is. */
static const char KAPPASKIN_DEVICE_JSON[] =
    "{\"name\":\"Kappaskin reference board, second prototype\",\"serial_number\":\"n"
    "ot set\",\"firmware\":\"1.0.0\",\"simulated\":false,\"rate\":333.333,\"rigidity\":0"
    ".0037,\"size\":[0.1,0.1],\"grid\":[10,10],\"dead_channels\":[],\"bridge\":{\"gage"
    "_factor\":2.1,\"substrate_thickness\":9.5e-05,\"gage_thickness\":3e-05,\"excit"
    "ation\":5.0,\"gage_resistance\":350.0,\"gage_mismatch\":0.0,\"dummy_resistance"
    "\":350.0,\"balance_voltage\":null},\"multiplexer\":{\"settling_time\":6.5e-06,\""
    "supply_resistance\":0.9},\"amplifier\":{\"gain\":100,\"rail\":2.5},\"converter\":"
    "{\"bits\":16,\"full_scale\":2.5,\"offset\":0.0,\"conversion_time\":3.5e-06}}";
